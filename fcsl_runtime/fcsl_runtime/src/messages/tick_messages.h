/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick has to show besides the instances' own messages, as fcsl_msgs messages: the recorder writes them into bags,
 * hosts publish them.
 */
#ifndef FCSL_TICK_MESSAGES_H
#define FCSL_TICK_MESSAGES_H

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_machine.h"
#include "fcsl/fcsl_run.h"

/* Instead of a time: tick k is at k / tick_hz. */
#define FCSL_TICK_TIME UINT64_MAX

/* A tick and its time, in ns. */
typedef struct {
    uint64_t tick;
    uint64_t time_ns;
} fcsl_stamp_t;

/* Begins a message of a tick with the header and tick number that all of them begin with. */
static inline void fcsl_tick_message_begin(fcsl_cdr_t *cdr, fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity)
{
    fcsl_cdr_begin(cdr, bytes, capacity);
    fcsl_cdr_header(cdr, stamp.time_ns);
    fcsl_cdr_u64(cdr, stamp.tick);
}

/* The message of a tick from the machine struct `data` that it left. Of the struct only the current and the next state are
 * read, and health, request and counters of each instance. Returns as fcsl_run_tick_message does. */
int64_t fcsl_tick_message_write(const fcsl_machine_t *machine, const uint8_t *data, fcsl_tick_message_t what,
                                fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity);

#endif /* FCSL_TICK_MESSAGES_H */
