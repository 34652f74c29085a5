/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds steps that take too long while they do. What it finds it reports and counts, once a step, and nothing more: only who
 * knows the vehicle can say what a stuck controller calls for.
 */
#ifndef FC_WATCHDOG_H
#define FC_WATCHDOG_H

#include <stddef.h>

#include "loop.h"

typedef struct {
    uint64_t limit_ns;    /* 0: no watchdog */
    uint64_t reported_ns; /* when the last step that was reported began */
} watchdog_t;

/* Whether the step that began at `begun_ns` (0: none runs) has run longer than the limit, and was not reported yet. */
int watchdog_finds(watchdog_t *watchdog, uint64_t begun_ns, uint64_t now_ns);

/* What the step thread is at: "tick 7 has run for 40 ms, now in instance 'nav' (nav.py:12)". From any thread. */
void watchdog_describe(const loop_t *loop, uint64_t now_ns, char *text, size_t capacity);

#endif /* FC_WATCHDOG_H */
