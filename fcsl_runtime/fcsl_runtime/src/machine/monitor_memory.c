/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes and checks what requirements remember.
 */
#include "monitor_memory.h"

#include <inttypes.h>

#include "fcsl/fcsl_scalar.h"
#include "machine_struct.h"

enum { AT_LAYOUT = FCSL_HASH_BYTES, AT_BYTES = 2 * FCSL_HASH_BYTES, HEAD_BYTES = AT_BYTES + 4 };

size_t fcsl_monitor_memory_bytes(const fcsl_monitor_t *monitor)
{
    return monitor != NULL ? (size_t)HEAD_BYTES + monitor->machine->size : 0;
}

void fcsl_monitor_memory_put(const fcsl_monitor_t *monitor, const uint8_t *data, uint8_t *out)
{
    fcsl_put_hash(out, monitor->machine->source_hash);
    fcsl_put_hash(out + AT_LAYOUT, monitor->machine->layout_hash);
    fcsl_put_u32(out + AT_BYTES, monitor->machine->size);
    fcsl_copy_canonical(monitor->machine, out + HEAD_BYTES, data);
}

int fcsl_monitor_memory_find(const fcsl_monitor_t *monitor, const uint8_t *memory, size_t size, const uint8_t **data,
                             fcsl_error_t *error)
{
    *data = NULL;
    if (size == 0) {
        return 0;
    }
    if (size < HEAD_BYTES || fcsl_get_u32(memory + AT_BYTES) != size - HEAD_BYTES) {
        return fcsl_fail(
            error, "the checkpoint is damaged: the memory of its requirements has %zu bytes, and says another size",
            size);
    }
    if (monitor == NULL || !fcsl_is_hash(memory, monitor->machine->source_hash) ||
        !fcsl_is_hash(memory + AT_LAYOUT, monitor->machine->layout_hash)) {
        return 0;
    }
    const char *wrong = size == fcsl_monitor_memory_bytes(monitor)
                            ? fcsl_struct_check(monitor->machine, memory + HEAD_BYTES)
                            : "its size";
    if (wrong != NULL) {
        return fcsl_fail(
            error, "the checkpoint is damaged: in the memory of its requirements '%.200s' has an impossible value",
            wrong);
    }
    *data = memory + HEAD_BYTES;
    return 0;
}
