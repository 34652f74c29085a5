/* SPDX-License-Identifier: Apache-2.0
 *
 * The channels of a machine for observers: what they hold after a tick, put on a session of the bus that listens (docs/reference/transports.md).
 * One thread posts, and it is not the one that steps. What an observer is too slow for is dropped on its way to it.
 */
#ifndef FCSL_TICK_PUBLISHER_H
#define FCSL_TICK_PUBLISHER_H

#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_tick_publisher fcsl_tick_publisher_t;

typedef struct {
    const char *endpoint;   /* "tcp:HOST:PORT", to listen on */
    const char *name_space; /* before the keys, "" for none */
    const char *descriptor; /* the text that answers queries for @descriptor */
    uint32_t write_bytes;   /* of the longest host write */
} fcsl_tick_publisher_options_t;

/* Listens. The machine's tables must outlive it. Returns 0, or -1 with `error` filled. */
int fcsl_tick_publisher_open(const fcsl_tick_publisher_options_t *options, const fcsl_machine_t *machine,
                             fcsl_tick_publisher_t **publisher, fcsl_error_t *error);

/* Whether an observer takes anything. */
int fcsl_tick_publisher_watched(const fcsl_tick_publisher_t *publisher);

/* Whether there is room for another tick. */
int fcsl_tick_publisher_ready(fcsl_tick_publisher_t *publisher);

/* Posts the values of a tick and its commits; `data` is the machine's struct after it, which counts as disarmed with
 * `requires_arming`. A sensor has a value where a sample came
 * since the tick that was posted before; in the first tick, and without a HAL, always. Returns 0, or -1: there is no room, and
 * commits are missing. */
int fcsl_tick_publisher_post(fcsl_tick_publisher_t *publisher, const void *data, uint64_t tick, uint64_t time_ns,
                             int requires_arming);

/* Whether an observer takes the host writes. */
int fcsl_tick_publisher_writes_watched(const fcsl_tick_publisher_t *publisher);

/* Posts a host write under @writes. Returns 0, or -1: there is no room. */
int fcsl_tick_publisher_post_write(fcsl_tick_publisher_t *publisher, const void *bytes, size_t size);

/* Posts under @written that after so many ticks the next write has this number. Returns as above. */
int fcsl_tick_publisher_post_written(fcsl_tick_publisher_t *publisher, uint64_t ticks, uint64_t number);

/* Answers queries for @checkpoint with these bytes from now on. Returns 0, or -1. */
int fcsl_tick_publisher_answer_checkpoint(fcsl_tick_publisher_t *publisher, const void *bytes, size_t size);

/* Nobody saw the last tick: the next one is a first one. */
void fcsl_tick_publisher_begin(fcsl_tick_publisher_t *publisher);

/* Puts what was posted, as far as that takes no longer than 2 s. Accepts null. */
void fcsl_tick_publisher_close(fcsl_tick_publisher_t *publisher);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_TICK_PUBLISHER_H */
