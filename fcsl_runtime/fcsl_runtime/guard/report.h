/* SPDX-License-Identifier: Apache-2.0
 *
 * What the guard prints while it runs.
 */
#ifndef GUARD_REPORT_H
#define GUARD_REPORT_H

#include "guard.h"

/* What was printed last. */
typedef struct {
    uint64_t next_ns; /* nothing is printed before: whoever sends nonsense does not fill the log */
    fcsl_gate_state_t state;
    int32_t pid; /* of the flight program; 0: none */
    uint64_t refused;
    uint64_t turned_away;
    uint64_t missed;
    uint64_t periods_missed;
} report_t;

/* Prints what has changed, ten times a second at most. */
void report_changes(report_t *report, const guard_t *guard, uint64_t now_ns);
/* The counters, at the end. */
void report_end(const guard_t *guard);

#endif /* GUARD_REPORT_H */
