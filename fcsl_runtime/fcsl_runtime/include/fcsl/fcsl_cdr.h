/* SPDX-License-Identifier: Apache-2.0
 *
 * Bounded writer of ROS 2 messages: CDR, little-endian, 4-byte encapsulation header, padding zeroed. A message that does
 * not fit is noticed once, at the end.
 */
#ifndef FCSL_CDR_H
#define FCSL_CDR_H

#include <stddef.h>
#include <stdint.h>

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

void fcsl_cdr_begin(fcsl_cdr_t *cdr, uint8_t *bytes, size_t capacity);
/* `alignment`: a power of two. */
void fcsl_cdr_align(fcsl_cdr_t *cdr, size_t alignment);
void fcsl_cdr_u8(fcsl_cdr_t *cdr, uint8_t value);
void fcsl_cdr_u32(fcsl_cdr_t *cdr, uint32_t value);
void fcsl_cdr_u64(fcsl_cdr_t *cdr, uint64_t value);
void fcsl_cdr_string(fcsl_cdr_t *cdr, const char *text);
/* Opens a byte sequence and returns where its bytes go, or null when it does not fit. */
uint8_t *fcsl_cdr_reserve_bytes(fcsl_cdr_t *cdr, uint32_t size);
/* builtin_interfaces/Time. */
void fcsl_cdr_time(fcsl_cdr_t *cdr, uint64_t time_ns);
/* std_msgs/Header of this stamp with an empty frame_id. */
void fcsl_cdr_header(fcsl_cdr_t *cdr, uint64_t time_ns);
/* Bytes of the message, or 0 when it did not fit. */
size_t fcsl_cdr_end(const fcsl_cdr_t *cdr);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_CDR_H */
