/* SPDX-License-Identifier: Apache-2.0
 *
 * When ticks are due: a pure function of clock readings, so that it is tested without a clock.
 *
 * Deadline k lies floor(k * 1e9 / tick_hz) ns after the anchor, an absolute time: no error adds up, and the deadlines keep
 * their places whatever happens to a tick. A tick is late when it begins at its next deadline or after it; the deadlines
 * that have passed by then are the backlog, and the policy says what becomes of it.
 */
#ifndef FC_PACING_H
#define FC_PACING_H

#include <stdint.h>

typedef enum {
    OVERRUN_CATCH_UP, /* the backlog's ticks are made at once, of at most CATCH_UP_NS; deadlines before that are skipped */
    OVERRUN_SKIP, /* the backlog's deadlines are skipped: the next tick waits for the next deadline */
    OVERRUN_STOP /* the late tick is not made: the run ends */
} overrun_t;

typedef struct {
    overrun_t overrun;
    uint64_t tick_hz;
    uint64_t anchor_ns; /* when deadline 0 is */
    uint64_t next; /* the deadline of the coming tick, counted from the anchor */
} pacing_t;

/* What pacing_begin_tick found. */
typedef struct {
    uint64_t lateness_ns; /* of this tick's deadline */
    uint64_t skipped; /* deadlines that will get no tick */
    int late;
    int stop; /* the policy ends the run before this tick */
} beginning_t;

/* The coming tick is due at `now_ns`, those behind it at exact distances. */
pacing_t pacing_start(overrun_t overrun, uint64_t tick_hz, uint64_t now_ns);
/* When the coming tick is due. */
uint64_t pacing_deadline(const pacing_t *pacing);
/* The coming tick begins at `now_ns`, which is not before its deadline. */
beginning_t pacing_begin_tick(pacing_t *pacing, uint64_t now_ns);

#endif /* FC_PACING_H */
