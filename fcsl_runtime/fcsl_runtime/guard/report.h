/* SPDX-License-Identifier: Apache-2.0
 *
 * What the guard prints while it runs.
 */
#ifndef GUARD_REPORT_H
#define GUARD_REPORT_H

#include "guard.h"

/* A counter, as it was printed last. */
typedef struct {
    uint64_t reported;
    uint64_t next_ns; /* not printed again before */
} report_count_t;

typedef struct {
    uint64_t paid_ns; /* lines of what comes and goes are paid for with time */
    uint64_t changes; /* of the gate's state, that were printed */
    int32_t pid; /* of the flight program; 0: none */
    report_count_t refused;
    report_count_t turned_away;
    report_count_t missed;
    report_count_t periods_missed;
} report_t;

/* Prints what has changed since the last call. Whoever flaps or sends nonsense does not fill the log: states and programs that
 * come and go have 20 lines, and another one every 0.1 s; a counter is printed once a second at most. */
void report_changes(report_t *report, const guard_t *guard, uint64_t now_ns);
/* The counters, at the end. */
void report_end(const guard_t *guard);

#endif /* GUARD_REPORT_H */
