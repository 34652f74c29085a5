/* SPDX-License-Identifier: Apache-2.0
 *
 * A run in lock-step with a simulator on the bus, for a host that has other things to do: it runs the ticks of some ten
 * milliseconds, publishes what they left in a publish queue, serves its clients, and runs the next ones. fcsl-fc has its own loop.
 *
 * Between two calls of fcsl_lockstep_run the run belongs to its host, which may write into it. One thread at a time.
 */
#ifndef FCSL_LOCKSTEP_H
#define FCSL_LOCKSTEP_H

#include "fcsl/fcsl_topics.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_lockstep fcsl_lockstep_t;

/* `address`: wire:SPEC (fcsl_wire.h), or as fcsl_hal_bus takes it and `name_space`. `topics` may be null. Run, topics and queue must outlive it. */
fcsl_lockstep_t *fcsl_lockstep_new(fcsl_run_t *run, fcsl_topics_t *topics, fcsl_publish_queue_t *queue,
                                   const char *address, const char *name_space, fcsl_error_t *error);
/* Leaves the simulator, too. */
void fcsl_lockstep_free(fcsl_lockstep_t *lockstep);

/* Looks for a simulator for up to `wait_ms`. Then each tick may take it `timeout_ms`. Returns 0; 1 when there is none yet: call
 * again, to look on; -1 when there will be none. `error` says why. */
int fcsl_lockstep_connect(fcsl_lockstep_t *lockstep, uint32_t wait_ms, uint32_t timeout_ms, fcsl_error_t *error);

typedef enum {
    FCSL_LOCKSTEP_RUNNING = 0,
    FCSL_LOCKSTEP_ENDED = 1, /* the simulator ended the run */
    FCSL_LOCKSTEP_AGAIN = 2, /* the same, and begins another one: connect anew */
    FCSL_LOCKSTEP_DISCONNECTED = 3 /* the simulator was killed, froze, or the link is cut; `error` says at which tick */
} fcsl_lockstep_status_t;

/* Makes the ticks that come within about `slice_ms`. Returns a fcsl_lockstep_status_t, or -1. */
int fcsl_lockstep_run(fcsl_lockstep_t *lockstep, uint32_t slice_ms, fcsl_error_t *error);

/* Takes no sample of a sensor channel (an index into channels) in the next `ticks` ticks. 0, or -1. */
int fcsl_lockstep_drop(fcsl_lockstep_t *lockstep, uint32_t channel, uint32_t ticks, fcsl_error_t *error);
/* Ends all dropouts. */
void fcsl_lockstep_drop_none(fcsl_lockstep_t *lockstep);

/* While no ticks are run, called often: the simulator waits on. */
void fcsl_lockstep_keep_alive(fcsl_lockstep_t *lockstep);
/* Tells the simulator that no tick is answered any more. Does nothing where none is connected. */
void fcsl_lockstep_leave(fcsl_lockstep_t *lockstep);

/* What the HAL counts under `path` (docs/hardware/hal.md), such as messages_dropped; 0 where none is connected. */
uint64_t fcsl_lockstep_count(const fcsl_lockstep_t *lockstep, const char *path);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_LOCKSTEP_H */
