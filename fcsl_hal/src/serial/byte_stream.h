/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames in a stream of bytes that may begin anywhere, lose bytes and damage them. What is no frame is dropped and counted.
 */
#ifndef FCSL_HAL_BYTE_STREAM_H
#define FCSL_HAL_BYTE_STREAM_H

#include "fcsl/fcsl_driver.h"

enum { BYTE_STREAM_MAX = 1024 }; /* bytes of the longest frame */

/* Looks at bytes that begin a frame, or do not: the length of a complete frame that they begin with, 0 while it may still become one,
 * or when it is none the reason (fcsl_driver_why_t), negative. */
typedef int32_t (*byte_stream_judge_t)(const uint8_t *bytes, uint32_t size);

/* The bytes are last, with no padding behind them, and a stream is the last member of what holds it: what is read or written behind
 * them lies outside of the object, where EVA and the sanitizers see it. */
typedef struct {
    uint32_t size; /* of what came, and was not dropped */
    uint32_t taken; /* of them, the frame that was returned last */
    uint32_t why; /* fcsl_driver_why_t: the largest one that was told */
    uint64_t frames;
    uint64_t garbage; /* bytes that belong to no frame */
    uint8_t bytes[BYTE_STREAM_MAX];
} byte_stream_t;

/* Takes the next byte. Returns the length of a frame that is complete now, which stays in `bytes` until the next call, or 0. Where a
 * damaged frame hid several, each comes with a byte of its own. */
uint32_t byte_stream_take(byte_stream_t *stream, uint8_t byte, byte_stream_judge_t judge);

/* What came so far does not go on: the next byte begins a frame. */
void byte_stream_break(byte_stream_t *stream);

/* Why no sample came of what was taken. */
void byte_stream_note(byte_stream_t *stream, uint32_t why);

/* Adds what the stream has counted to *input, and counts anew. */
void byte_stream_report(byte_stream_t *stream, fcsl_driver_input_t *input);

#endif /* FCSL_HAL_BYTE_STREAM_H */
