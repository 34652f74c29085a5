/* SPDX-License-Identifier: Apache-2.0
 *
 * Frames as bytes, for tests that send, damage and compare them.
 */
#ifndef TEST_FRAMES_H
#define TEST_FRAMES_H

#include "fcsl/fcsl_codec.h"

/* The bytes of the frame, or 0 when `capacity` is too small. */
static inline size_t encode_frame(const fcsl_machine_t *machine, const void *data, fcsl_direction_t direction,
                                  uint64_t tick, const uint8_t *select, uint8_t *bytes, size_t capacity)
{
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    fcsl_frame_t frame;
    return fcsl_frame_encode(&table, data, direction, tick, select, bytes, capacity, &frame) == 0 ? frame.size : 0;
}

/* Checks the bytes, and puts what they say into `data`. */
static inline fcsl_frame_status_t decode_frame(const fcsl_machine_t *machine, void *data, fcsl_direction_t direction,
                                               const uint8_t *bytes, size_t size, uint64_t *tick)
{
    const fcsl_channel_table_t table = fcsl_channel_table(machine);
    fcsl_frame_t frame;
    const fcsl_frame_status_t status = fcsl_frame_check(&table, direction, bytes, size, &frame);
    if (status == FCSL_FRAME_OK) {
        fcsl_frame_apply(machine, data, &frame);
        *tick = frame.tick;
    }
    return status;
}

#endif /* TEST_FRAMES_H */
