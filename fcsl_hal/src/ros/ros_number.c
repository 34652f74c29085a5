/* SPDX-License-Identifier: Apache-2.0
 *
 * Reads, converts, checks and writes numbers by the rows of a conversion.
 */
#include "ros_number.h"

#include <math.h>
#include <string.h>

/* A number of any type, without loss. */
typedef enum { SIGNED, UNSIGNED, FLOAT } kind_t;

typedef struct {
    kind_t kind;
    union {
        int64_t i;
        uint64_t u;
        double f;
    };
} number_t;

/* The least double that a float32 cannot hold: halfway between the largest one and the next, which would be infinite. */
#define F32_BEYOND 0x1.ffffffp+127
#define TWO_TO_63  0x1p+63
#define TWO_TO_64  0x1p+64

uint32_t fcsl_ros_scalar_size(uint8_t type)
{
    static const uint8_t sizes[] = {1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    return type < sizeof sizes ? sizes[type] : 0u;
}

int fcsl_ros_rows_valid(const fcsl_ros_row_t *rows, uint32_t row_count, uint32_t term_count, uint32_t size)
{
    for (uint32_t i = 0; i < row_count; i++) {
        const fcsl_ros_row_t *row = &rows[i];
        const uint64_t bytes = ((uint64_t)row->more + 1u) * fcsl_ros_scalar_size(row->type);
        if (bytes == 0 || bytes > size || row->offset > size - bytes || row->term_count == 0 ||
            row->term_count > term_count || row->first_term > term_count - row->term_count ||
            (row->more > 0 && row->term_count > 1u)) {
            return 0;
        }
    }
    return 1;
}

#define LOAD(c_type, number_kind, member)                                                                              \
    {                                                                                                                  \
        c_type value = 0;                                                                                              \
        memcpy(&value, at, sizeof value);                                                                              \
        *number = (number_t){.kind = (number_kind), .member = value};                                                  \
        return FCSL_ROS_TAKEN;                                                                                         \
    }

static inline fcsl_ros_status_t load(uint8_t type, const uint8_t *at, number_t *number)
{
    switch (type) {
    case FCSL_ROS_BOOL:
        *number = (number_t){.kind = UNSIGNED, .u = *at};
        return *at <= 1u ? FCSL_ROS_TAKEN : FCSL_ROS_RANGE;
    case FCSL_ROS_I8:
        LOAD(int8_t, SIGNED, i)
    case FCSL_ROS_U8:
        LOAD(uint8_t, UNSIGNED, u)
    case FCSL_ROS_I16:
        LOAD(int16_t, SIGNED, i)
    case FCSL_ROS_U16:
        LOAD(uint16_t, UNSIGNED, u)
    case FCSL_ROS_I32:
        LOAD(int32_t, SIGNED, i)
    case FCSL_ROS_U32:
        LOAD(uint32_t, UNSIGNED, u)
    case FCSL_ROS_I64:
        LOAD(int64_t, SIGNED, i)
    case FCSL_ROS_U64:
        LOAD(uint64_t, UNSIGNED, u)
    case FCSL_ROS_F32:
        LOAD(float, FLOAT, f)
    default:
        LOAD(double, FLOAT, f)
    }
}

static inline double as_double(const number_t *number)
{
    return number->kind == FLOAT ? number->f : number->kind == SIGNED ? (double)number->i : (double)number->u;
}

/* A whole double as an integer; anything else is out of range. */
static int make_integer(number_t *number)
{
    const double value = number->f;
    if (value >= -TWO_TO_63 && value < TWO_TO_63) {
        *number = (number_t){.kind = SIGNED, .i = (int64_t)value};
        return (double)number->i == value;
    }
    if (value >= 0.0 && value < TWO_TO_64) {
        *number = (number_t){.kind = UNSIGNED, .u = (uint64_t)value}; /* doubles of this size are whole */
        return 1;
    }
    return 0;
}

static int fits(const number_t *number, int64_t low, uint64_t high)
{
    return number->kind == SIGNED ? number->i >= low && (number->i < 0 || (uint64_t)number->i <= high)
                                  : number->u <= high;
}

#define STORE(c_type, low, high)                                                                                       \
    {                                                                                                                  \
        if (!fits(&number, low, high)) {                                                                               \
            return FCSL_ROS_RANGE;                                                                                     \
        }                                                                                                              \
        const c_type value = number.kind == SIGNED ? (c_type)number.i : (c_type)number.u;                              \
        memcpy(out, &value, sizeof value);                                                                             \
        return FCSL_ROS_TAKEN;                                                                                         \
    }

static fcsl_ros_status_t store_integer(uint8_t type, number_t number, uint8_t *out)
{
    switch (type) {
    case FCSL_ROS_BOOL:
        STORE(uint8_t, 0, 1)
    case FCSL_ROS_I8:
        STORE(int8_t, INT8_MIN, INT8_MAX)
    case FCSL_ROS_U8:
        STORE(uint8_t, 0, UINT8_MAX)
    case FCSL_ROS_I16:
        STORE(int16_t, INT16_MIN, INT16_MAX)
    case FCSL_ROS_U16:
        STORE(uint16_t, 0, UINT16_MAX)
    case FCSL_ROS_I32:
        STORE(int32_t, INT32_MIN, INT32_MAX)
    case FCSL_ROS_U32:
        STORE(uint32_t, 0, UINT32_MAX)
    case FCSL_ROS_I64:
        STORE(int64_t, INT64_MIN, INT64_MAX)
    default:
        STORE(uint64_t, 0, UINT64_MAX)
    }
}

static fcsl_ros_status_t store_f32(const number_t *number, uint8_t *out)
{
    float value = 0.0f;
    if (number->kind == FLOAT) {
        const int finite = number->f - number->f == 0.0;
        if (finite && (number->f >= F32_BEYOND || number->f <= -F32_BEYOND)) {
            return FCSL_ROS_RANGE;
        }
        value = (float)number->f;
    } else {
        value = number->kind == SIGNED ? (float)number->i : (float)number->u;
    }
    memcpy(out, &value, sizeof value);
    return FCSL_ROS_TAKEN;
}

static inline fcsl_ros_status_t store(uint8_t type, number_t *number, int nan_allowed, uint8_t *out)
{
    if (number->kind == FLOAT && number->f != number->f) {
        if (!nan_allowed || (type != FCSL_ROS_F32 && type != FCSL_ROS_F64)) {
            return FCSL_ROS_NAN;
        }
        number->f = (double)NAN; /* the canonical one: the others differ between processors */
    }
    if (type == FCSL_ROS_F64) {
        const double value = as_double(number);
        memcpy(out, &value, sizeof value);
        return FCSL_ROS_TAKEN;
    }
    if (type == FCSL_ROS_F32) {
        return store_f32(number, out);
    }
    return number->kind == FLOAT && !make_integer(number) ? FCSL_ROS_RANGE : store_integer(type, *number, out);
}

/* Whether the row has the number of its only term, and nothing is computed. */
static int is_exact(const fcsl_ros_row_t *row, const fcsl_ros_term_t *term)
{
    return row->term_count == 1 && term->factor == 1.0 && !row->scaled;
}

/* Number `n` of a row. */
static fcsl_ros_status_t apply(const fcsl_ros_row_t *row, const fcsl_ros_term_t *term, const uint8_t *const *anchors,
                               uint32_t n, int nan_allowed, uint8_t *out)
{
    number_t number = {.kind = FLOAT};
    double sum = 0.0;
    for (uint32_t i = 0; i < row->term_count; i++) {
        const uint8_t *at = anchors[term[i].anchor];
        if (at == NULL) {
            return FCSL_ROS_SHAPE;
        }
        at += term[i].offset + (size_t)n * fcsl_ros_scalar_size(term[i].type);
        const fcsl_ros_status_t status = load(term[i].type, at, &number);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
        const double product = term[i].factor * as_double(&number);
        sum = i == 0 ? product : sum + product;
    }
    if (!is_exact(row, term)) {
        number = (number_t){.kind = FLOAT, .f = row->scaled ? sum * row->scale + row->bias : sum};
    }
    return store(row->type, &number, nan_allowed, out + row->offset + (size_t)n * fcsl_ros_scalar_size(row->type));
}

/* Most numbers are doubles that stay as they are. Returns how many of the row were; the first that is not is a NaN. */
static uint32_t copied_doubles(const fcsl_ros_row_t *row, const fcsl_ros_term_t *term, const uint8_t *const *anchors,
                               uint8_t *out)
{
    const uint8_t *from = anchors[term->anchor];
    if (!is_exact(row, term) || term->type != FCSL_ROS_F64 || row->type != FCSL_ROS_F64 || from == NULL) {
        return 0;
    }
    for (uint32_t n = 0; n <= row->more; n++) {
        double value = 0.0;
        memcpy(&value, from + term->offset + sizeof value * (size_t)n, sizeof value);
        if (value != value) {
            return n;
        }
        memcpy(out + row->offset + sizeof value * (size_t)n, &value, sizeof value);
    }
    return row->more + 1u;
}

fcsl_ros_status_t fcsl_ros_row_apply(const fcsl_ros_row_t *row, const fcsl_ros_term_t *terms,
                                     const uint8_t *const *anchors, int nan_allowed, uint8_t *out)
{
    const fcsl_ros_term_t *term = &terms[row->first_term];
    fcsl_ros_status_t status = FCSL_ROS_TAKEN;
    uint32_t n = copied_doubles(row, term, anchors, out);
    for (; n <= row->more && status == FCSL_ROS_TAKEN; n++) {
        status = apply(row, term, anchors, n, nan_allowed, out);
    }
    return status;
}

int fcsl_ros_guard_holds(const fcsl_ros_guard_t *guard, const uint8_t *const *anchors)
{
    number_t number = {.kind = FLOAT};
    const uint8_t *anchor = anchors[guard->at.anchor];
    return anchor != NULL && load(guard->at.type, anchor + guard->at.offset, &number) == FCSL_ROS_TAKEN &&
           as_double(&number) == guard->value;
}
