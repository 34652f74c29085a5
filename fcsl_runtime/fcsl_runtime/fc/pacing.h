/* SPDX-License-Identifier: Apache-2.0
 *
 * When ticks are due: a pure function of clock readings, so that it is tested without a clock.
 *
 * Deadline k lies floor(k * 1e9 / tick_hz) ns after the anchor, an absolute time: no error adds up, and the deadlines keep
 * their places whatever happens to a tick. A deadline is missed when the next one has come before its tick begins; the
 * policy decides what happens to missed deadlines. The ROS node's pacer (fcsl_bridge/loops/pacer.py) is the policy skip.
 */
#ifndef FC_PACING_H
#define FC_PACING_H

#include <stdint.h>

typedef enum {
    MISSED_CATCH_UP, /* they get their ticks at once, one behind the other; of more than 0.1 s the oldest get none */
    MISSED_SKIP, /* they get no tick; the newest deadline, less than a period old, gets its tick at once */
    MISSED_STOP /* the run ends */
} missed_deadline_t;

typedef struct {
    missed_deadline_t missed_deadline;
    uint64_t tick_hz;
    uint64_t anchor_ns; /* when deadline 0 is */
    uint64_t next; /* the deadline of the coming tick, counted from the anchor */
} pacing_t;

typedef enum { PACING_TICK, PACING_STOP } pacing_verdict_t;

typedef struct {
    pacing_verdict_t verdict;
    uint64_t lateness_ns; /* how long after the deadline the loop came to it */
    uint64_t
        missed; /* deadlines whose successor came before their tick began: those skipped, and the one of a late tick */
    uint64_t skipped; /* deadlines that get no tick */
} arrival_t;

/* The coming tick is due at `now_ns`, those behind it at exact distances. */
pacing_t pacing_start(missed_deadline_t missed_deadline, uint64_t tick_hz, uint64_t now_ns);
/* When the coming tick is due. */
uint64_t pacing_deadline(const pacing_t *pacing);
/* The loop comes to the deadline of the coming tick at `now_ns`, which is not before it: make the tick now, or
 * end the run. */
arrival_t pacing_arrive(pacing_t *pacing, uint64_t now_ns);

#endif /* FC_PACING_H */
