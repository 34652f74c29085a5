/* SPDX-License-Identifier: Apache-2.0
 *
 * Scalars of a machine struct as bytes: sizes, validity, and the little-endian form with canonical NaNs in which they
 * leave and enter a process. The same program run on another processor must give the same bytes, and processors disagree
 * about the sign and payload of a NaN.
 */
#ifndef FCSL_SCALAR_H
#define FCSL_SCALAR_H

#include <string.h>

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of one scalar, 0 for an unknown type. */
static inline uint32_t fcsl_scalar_size(uint8_t type)
{
    static const uint8_t sizes[] = {1, 4, 8, 4, 8, 4, 8, 4, 4, 4};
    return type < sizeof sizes ? sizes[type] : 0u;
}

static inline void fcsl_put_u16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
}

static inline void fcsl_put_u32(uint8_t *out, uint32_t value)
{
    fcsl_put_u16(out, (uint16_t)value);
    fcsl_put_u16(out + 2, (uint16_t)(value >> 16));
}

static inline void fcsl_put_u64(uint8_t *out, uint64_t value)
{
    fcsl_put_u32(out, (uint32_t)value);
    fcsl_put_u32(out + 4, (uint32_t)(value >> 32));
}

static inline uint16_t fcsl_get_u16(const uint8_t *in)
{
    return (uint16_t)(in[0] | ((uint16_t)in[1] << 8));
}

static inline uint32_t fcsl_get_u32(const uint8_t *in)
{
    return (uint32_t)fcsl_get_u16(in) | ((uint32_t)fcsl_get_u16(in + 2) << 16);
}

static inline uint64_t fcsl_get_u64(const uint8_t *in)
{
    return (uint64_t)fcsl_get_u32(in) | ((uint64_t)fcsl_get_u32(in + 4) << 32);
}

/* Any NaN becomes the quiet one with a clear sign. */
static inline uint32_t fcsl_canonical_f32(uint32_t bits)
{
    return (bits & 0x7fffffffu) > 0x7f800000u ? 0x7fc00000u : bits;
}

static inline uint64_t fcsl_canonical_f64(uint64_t bits)
{
    return (bits & UINT64_C(0x7fffffffffffffff)) > UINT64_C(0x7ff0000000000000) ? UINT64_C(0x7ff8000000000000) : bits;
}

/* Native scalars to little-endian bytes. */
static inline void fcsl_scalars_export(uint8_t *out, const void *in, uint8_t type, uint32_t count)
{
    const uint8_t *from = (const uint8_t *)in;
    const uint32_t size = fcsl_scalar_size(type);
    if (size == 1u) {
        memcpy(out, from, count);
    } else if (size == 4u) {
        for (uint32_t i = 0; i < count; i++) {
            uint32_t bits = 0;
            memcpy(&bits, from + 4u * (size_t)i, 4u);
            fcsl_put_u32(out + 4u * (size_t)i, type == FCSL_F32 ? fcsl_canonical_f32(bits) : bits);
        }
    } else if (size == 8u) {
        for (uint32_t i = 0; i < count; i++) {
            uint64_t bits = 0;
            memcpy(&bits, from + 8u * (size_t)i, 8u);
            fcsl_put_u64(out + 8u * (size_t)i, type == FCSL_F64 ? fcsl_canonical_f64(bits) : bits);
        }
    }
}

/* Little-endian bytes to native scalars. */
static inline void fcsl_scalars_import(void *out, const uint8_t *in, uint8_t type, uint32_t count)
{
    uint8_t *to = (uint8_t *)out;
    const uint32_t size = fcsl_scalar_size(type);
    if (size == 1u) {
        memcpy(to, in, count);
    } else if (size == 4u) {
        for (uint32_t i = 0; i < count; i++) {
            const uint32_t raw = fcsl_get_u32(in + 4u * (size_t)i);
            const uint32_t bits = type == FCSL_F32 ? fcsl_canonical_f32(raw) : raw;
            memcpy(to + 4u * (size_t)i, &bits, 4u);
        }
    } else if (size == 8u) {
        for (uint32_t i = 0; i < count; i++) {
            const uint64_t raw = fcsl_get_u64(in + 8u * (size_t)i);
            const uint64_t bits = type == FCSL_F64 ? fcsl_canonical_f64(raw) : raw;
            memcpy(to + 8u * (size_t)i, &bits, 8u);
        }
    }
}

#define FCSL_SCALAR_AS_DOUBLE(type_)                                                                                   \
    {                                                                                                                  \
        type_ value;                                                                                                   \
        memcpy(&value, bytes, sizeof value);                                                                           \
        return (double)value;                                                                                          \
    }

/* A scalar in native byte order, FCSL_BOOL to FCSL_F64, rounded to the nearest double. */
static inline double fcsl_scalar_as_double(const uint8_t *bytes, uint8_t type)
{
    switch (type) {
    case FCSL_I32:
        FCSL_SCALAR_AS_DOUBLE(int32_t)
    case FCSL_I64:
        FCSL_SCALAR_AS_DOUBLE(int64_t)
    case FCSL_U32:
        FCSL_SCALAR_AS_DOUBLE(uint32_t)
    case FCSL_U64:
        FCSL_SCALAR_AS_DOUBLE(uint64_t)
    case FCSL_F32:
        FCSL_SCALAR_AS_DOUBLE(float)
    case FCSL_F64:
        FCSL_SCALAR_AS_DOUBLE(double)
    default:
        FCSL_SCALAR_AS_DOUBLE(uint8_t)
    }
}

/* True when every little-endian scalar is a value of its type: bools 0 or 1, enumerators that exist. */
static inline int fcsl_scalars_valid(const fcsl_machine_t *machine, const uint8_t *in, uint8_t type, uint32_t count)
{
    uint32_t limit = 0;
    switch (type) {
    case FCSL_BOOL:
        for (uint32_t i = 0; i < count; i++) {
            if (in[i] > 1u) {
                return 0;
            }
        }
        return 1;
    case FCSL_TRANSITION_REQUEST:
        limit = machine->request_count + 1u;
        break;
    case FCSL_HEALTH:
        limit = (uint32_t)FCSL_STALE + 1u;
        break;
    case FCSL_STATE:
        limit = machine->state_count;
        break;
    default:
        return fcsl_scalar_size(type) != 0u;
    }
    for (uint32_t i = 0; i < count; i++) {
        if (fcsl_get_u32(in + 4u * (size_t)i) >= limit) {
            return 0;
        }
    }
    return 1;
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_SCALAR_H */
