/* SPDX-License-Identifier: Apache-2.0
 *
 * Ranges of parameters, compared in the type of the value.
 */
#include "range.h"

#include <math.h>

#include "fcsl/fcsl_scalar.h"

/* The integers of a type as doubles: low <= x < end, both powers of two (or zero) and so exact. */
static const double INTEGERS[][2] = {
    [FCSL_I32] = {-0x1p31, 0x1p31},
    [FCSL_I64] = {-0x1p63, 0x1p63},
    [FCSL_U32] = {0.0, 0x1p32},
    [FCSL_U64] = {0.0, 0x1p64},
};

int fcsl_bound_fits(double bound, uint8_t type)
{
    if (isinf(bound)) {
        return 1;
    }
    if (type == FCSL_F64 || type == FCSL_F32) {
        return bound == bound && (type == FCSL_F64 || (double)(float)bound == bound);
    }
    if (type < FCSL_I32 || type > FCSL_U64 || !(bound >= INTEGERS[type][0] && bound < INTEGERS[type][1])) {
        return 0;
    }
    return bound < 0.0 ? (double)(int64_t)bound == bound : (double)(uint64_t)bound == bound;
}

static int float_within(double value, const fcsl_field_t *field)
{
    return value >= field->minimum && value <= field->maximum;
}

static int signed_within(int64_t value, const fcsl_field_t *field)
{
    return (isinf(field->minimum) || value >= (int64_t)field->minimum) &&
           (isinf(field->maximum) || value <= (int64_t)field->maximum);
}

static int unsigned_within(uint64_t value, const fcsl_field_t *field)
{
    return (isinf(field->minimum) || value >= (uint64_t)field->minimum) &&
           (isinf(field->maximum) || value <= (uint64_t)field->maximum);
}

static int scalar_within(const uint8_t *at, const fcsl_field_t *field)
{
    const uint32_t low = fcsl_get_u32(at);
    const uint64_t wide = fcsl_scalar_size(field->type) == 8u ? fcsl_get_u64(at) : low;
    float single = 0.0f;
    double real = 0.0;
    switch (field->type) {
    case FCSL_I32:
        return signed_within((int32_t)low, field);
    case FCSL_I64:
        return signed_within((int64_t)wide, field);
    case FCSL_F32:
        memcpy(&single, &low, sizeof single);
        return float_within(single, field);
    case FCSL_F64:
        memcpy(&real, &wide, sizeof real);
        return float_within(real, field);
    default:
        return unsigned_within(wide, field);
    }
}

int fcsl_scalars_within(const uint8_t *bytes, const fcsl_field_t *field, uint32_t count)
{
    if (isinf(field->minimum) && isinf(field->maximum)) {
        return 1;
    }
    const uint32_t size = fcsl_scalar_size(field->type);
    for (uint32_t i = 0; i < count; i++) {
        if (!scalar_within(bytes + (size_t)i * size, field)) {
            return 0;
        }
    }
    return 1;
}
