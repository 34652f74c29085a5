/* SPDX-License-Identifier: Apache-2.0
 *
 * The machine struct with one NaN for all. NaNs are rare: a field is looked at first, which vector registers do.
 */
#include "machine_struct.h"

#include "fcsl/fcsl_scalar.h"

/* The top bit of what is gathered tells of a NaN: without its sign it is above infinity. */
static int has_nan_f64(const uint8_t *at, uint32_t count)
{
    uint64_t found = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, at + 8u * (size_t)i, sizeof bits);
        found |= UINT64_C(0x7ff0000000000000) - (bits & UINT64_C(0x7fffffffffffffff));
    }
    return (found >> 63) != 0;
}

static int has_nan_f32(const uint8_t *at, uint32_t count)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t bits = 0;
        memcpy(&bits, at + 4u * (size_t)i, sizeof bits);
        found |= 0x7f800000u - (bits & 0x7fffffffu);
    }
    return (found >> 31) != 0;
}

static void make_canonical_f64(uint8_t *at, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint64_t bits = 0;
        memcpy(&bits, at + 8u * (size_t)i, sizeof bits);
        bits = fcsl_canonical_f64(bits);
        memcpy(at + 8u * (size_t)i, &bits, sizeof bits);
    }
}

static void make_canonical_f32(uint8_t *at, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t bits = 0;
        memcpy(&bits, at + 4u * (size_t)i, sizeof bits);
        bits = fcsl_canonical_f32(bits);
        memcpy(at + 4u * (size_t)i, &bits, sizeof bits);
    }
}

void fcsl_copy_canonical(const fcsl_machine_t *machine, uint8_t *out, const uint8_t *in)
{
    memcpy(out, in, machine->size);
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        uint8_t *at = out + field->offset;
        if (field->type == FCSL_F64 && has_nan_f64(at, field->count)) {
            make_canonical_f64(at, field->count);
        } else if (field->type == FCSL_F32 && has_nan_f32(at, field->count)) {
            make_canonical_f32(at, field->count);
        }
    }
}
