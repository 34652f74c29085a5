/* SPDX-License-Identifier: Apache-2.0
 *
 * The struct of a machine, as bytes that its descriptor explains.
 */
#ifndef FCSL_MACHINE_STRUCT_H
#define FCSL_MACHINE_STRUCT_H

#include <string.h>

#include "fcsl/fcsl_machine.h"

/* The room of a machine struct, and its alignment: whole cache lines, so that whole blocks may be copied. */
static inline size_t fcsl_run_data_align(const fcsl_machine_t *machine)
{
    return machine->align < 64u ? 64u : machine->align;
}

static inline size_t fcsl_run_data_bytes(const fcsl_machine_t *machine)
{
    const size_t align = fcsl_run_data_align(machine);
    return ((size_t)machine->size + align - 1u) / align * align;
}

static inline int32_t fcsl_read_i32(const uint8_t *data, uint32_t offset)
{
    int32_t value = 0;
    memcpy(&value, data + offset, sizeof value);
    return value;
}

static inline uint32_t fcsl_read_u32(const uint8_t *data, uint32_t offset)
{
    uint32_t value = 0;
    memcpy(&value, data + offset, sizeof value);
    return value;
}

static inline uint64_t fcsl_read_u64(const uint8_t *data, uint32_t offset)
{
    uint64_t value = 0;
    memcpy(&value, data + offset, sizeof value);
    return value;
}

/* Copies the struct with canonical NaNs in every float field: what leaves the process does not depend on the processor. */
void fcsl_copy_canonical(const fcsl_machine_t *machine, uint8_t *out, const uint8_t *in);

/* A struct comes from outside: what the machine uses as an index or a boolean must be one. The path of a field of which this is
 * not so; null: all is well. */
const char *fcsl_struct_check(const fcsl_machine_t *machine, const uint8_t *bytes);

/* A hash of a descriptor as bytes, its text filled with zeros. */
enum { FCSL_HASH_BYTES = 64 };

static inline void fcsl_put_hash(uint8_t *out, const char *hash)
{
    size_t length = 0;
    while (length < FCSL_HASH_BYTES && hash[length] != '\0') {
        length++;
    }
    memset(out, 0, FCSL_HASH_BYTES);
    memcpy(out, hash, length);
}

static inline int fcsl_is_hash(const uint8_t *held, const char *hash)
{
    uint8_t here[FCSL_HASH_BYTES];
    fcsl_put_hash(here, hash);
    return memcmp(held, here, FCSL_HASH_BYTES) == 0;
}

#endif /* FCSL_MACHINE_STRUCT_H */
