/* SPDX-License-Identifier: Apache-2.0
 *
 * The time that a controller computes: its actuator messages act so many ticks after the tick they are made in.
 */
#ifndef FCSL_SIM_DELAY_H
#define FCSL_SIM_DELAY_H

#include "fcsl/fcsl_codec.h"

typedef struct {
    uint32_t ticks;
    size_t slot_bytes;
    uint8_t *slots; /* ticks + 1 messages, each behind its size */
} fcsl_delay_t;

/* For messages of up to `capacity` bytes. Returns 0, or -1 without memory. */
int fcsl_delay_open(fcsl_delay_t *delay, uint32_t ticks, size_t capacity);
void fcsl_delay_free(fcsl_delay_t *delay);
/* Takes the message of a tick, or null where there was none; *due is the one that acts now, in the delay's memory until the next
 * call. Returns 0 where there is none. */
int fcsl_delay_pass(fcsl_delay_t *delay, const fcsl_channel_table_t *table, uint64_t tick,
                    const fcsl_message_t *message, fcsl_message_t *due);
/* What a checkpoint needs: so many bytes from `slots` on. */
size_t fcsl_delay_bytes(const fcsl_delay_t *delay);

#endif /* FCSL_SIM_DELAY_H */
