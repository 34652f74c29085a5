/* SPDX-License-Identifier: Apache-2.0
 *
 * Bounded writer of ROS 2 messages: CDR, little-endian, 4-byte encapsulation header, padding zeroed. A message that does
 * not fit is noticed once, at the end.
 */
#ifndef FCSL_CDR_H
#define FCSL_CDR_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FCSL_SCHEMA_SEPARATOR "================================================================================\n"

/* What every message with a header depends on, behind its own ros2msg text. */
#define FCSL_SCHEMA_HEADER                                                                                             \
    FCSL_SCHEMA_SEPARATOR                                                                                              \
    "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" FCSL_SCHEMA_SEPARATOR                     \
    "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"

enum { FCSL_CDR_ENCAPSULATION_BYTES = 4 };

typedef struct {
    uint8_t *bytes;
    size_t capacity;
    size_t at; /* beyond capacity once the message has overflowed */
} fcsl_cdr_t;

/* Advances by `size` and returns where those bytes go, or null when they do not fit. */
static inline uint8_t *fcsl_cdr_take(fcsl_cdr_t *cdr, size_t size)
{
    const size_t at = cdr->at;
    if (at > cdr->capacity || cdr->capacity - at < size) {
        cdr->at = SIZE_MAX;
        return NULL;
    }
    cdr->at = at + size;
    return cdr->bytes + at;
}

static inline void fcsl_cdr_begin(fcsl_cdr_t *cdr, uint8_t *bytes, size_t capacity)
{
    cdr->bytes = bytes;
    cdr->capacity = capacity;
    cdr->at = 0;
    uint8_t *out = fcsl_cdr_take(cdr, FCSL_CDR_ENCAPSULATION_BYTES);
    if (out != NULL) {
        fcsl_put_u32(out, 0x100u); /* CDR, little-endian */
    }
}

/* `alignment`: a power of two. */
static inline void fcsl_cdr_align(fcsl_cdr_t *cdr, size_t alignment)
{
    if (cdr->at > cdr->capacity) {
        return;
    }
    const size_t behind = (cdr->at - (size_t)FCSL_CDR_ENCAPSULATION_BYTES) & (alignment - 1u);
    const size_t padding = behind == 0 ? 0 : alignment - behind;
    uint8_t *out = fcsl_cdr_take(cdr, padding);
    if (out != NULL) {
        memset(out, 0, padding);
    }
}

static inline void fcsl_cdr_u8(fcsl_cdr_t *cdr, uint8_t value)
{
    uint8_t *out = fcsl_cdr_take(cdr, 1);
    if (out != NULL) {
        *out = value;
    }
}

static inline void fcsl_cdr_u32(fcsl_cdr_t *cdr, uint32_t value)
{
    fcsl_cdr_align(cdr, 4);
    uint8_t *out = fcsl_cdr_take(cdr, 4);
    if (out != NULL) {
        fcsl_put_u32(out, value);
    }
}

static inline void fcsl_cdr_u64(fcsl_cdr_t *cdr, uint64_t value)
{
    fcsl_cdr_align(cdr, 8);
    uint8_t *out = fcsl_cdr_take(cdr, 8);
    if (out != NULL) {
        fcsl_put_u64(out, value);
    }
}

static inline void fcsl_cdr_string(fcsl_cdr_t *cdr, const char *text)
{
    const size_t size = strlen(text) + 1;
    if (size > UINT32_MAX) {
        cdr->at = SIZE_MAX;
        return;
    }
    fcsl_cdr_u32(cdr, (uint32_t)size);
    uint8_t *out = fcsl_cdr_take(cdr, size);
    if (out != NULL) {
        memcpy(out, text, size);
    }
}

/* Opens a byte sequence and returns where its bytes go, or null when it does not fit. */
static inline uint8_t *fcsl_cdr_reserve_bytes(fcsl_cdr_t *cdr, uint32_t size)
{
    fcsl_cdr_u32(cdr, size);
    return fcsl_cdr_take(cdr, size);
}

/* builtin_interfaces/Time. */
static inline void fcsl_cdr_time(fcsl_cdr_t *cdr, uint64_t time_ns)
{
    fcsl_cdr_u32(cdr, (uint32_t)(time_ns / 1000000000u));
    fcsl_cdr_u32(cdr, (uint32_t)(time_ns % 1000000000u));
}

/* std_msgs/Header of this stamp with an empty frame_id. */
static inline void fcsl_cdr_header(fcsl_cdr_t *cdr, uint64_t time_ns)
{
    fcsl_cdr_time(cdr, time_ns);
    fcsl_cdr_string(cdr, "");
}

/* Bytes of the message, or 0 when it did not fit. */
static inline size_t fcsl_cdr_end(const fcsl_cdr_t *cdr)
{
    return cdr->at <= cdr->capacity ? cdr->at : 0;
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_CDR_H */
