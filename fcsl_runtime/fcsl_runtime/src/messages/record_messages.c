/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes checkpoints and host writes as CDR.
 */
#include "record_messages.h"

#include <string.h>

#include "machine/machine_struct.h"
#include "machine/monitor_memory.h"

size_t fcsl_write_message(const fcsl_write_t *write, fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity)
{
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, bytes, capacity);
    fcsl_cdr_u8(&cdr, (uint8_t)write->kind);
    fcsl_cdr_string(&cdr, write->path);
    fcsl_cdr_u32(&cdr, write->element);
    fcsl_cdr_u32(&cdr, write->age_ticks);
    fcsl_cdr_u64(&cdr, (uint64_t)write->stamp_ns);
    uint8_t *data = fcsl_cdr_reserve_bytes(&cdr, write->size);
    if (data != NULL && write->size > 0) {
        memcpy(data, write->data, write->size);
    }
    return fcsl_cdr_end(&cdr);
}

size_t fcsl_checkpoint_message(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_monitor_t *monitor,
                               const uint8_t *remembered, fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity)
{
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, bytes, capacity);
    fcsl_cdr_string(&cdr, machine->name);
    fcsl_cdr_string(&cdr, machine->source_hash);
    fcsl_cdr_string(&cdr, machine->layout_hash);
    fcsl_cdr_string(&cdr, machine->build_hash);
    const size_t memory_bytes = fcsl_monitor_memory_bytes(monitor);
    uint8_t *copy = fcsl_cdr_reserve_bytes(&cdr, machine->size + (uint32_t)memory_bytes);
    if (copy != NULL) {
        fcsl_copy_canonical(machine, copy, data);
    }
    if (copy != NULL && memory_bytes > 0) {
        fcsl_monitor_memory_put(monitor, remembered, copy + machine->size);
    }
    return fcsl_cdr_end(&cdr);
}
