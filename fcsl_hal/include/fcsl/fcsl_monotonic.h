/* SPDX-License-Identifier: Apache-2.0
 *
 * CLOCK_MONOTONIC in nanoseconds: the one clock of everything that waits or measures. Needs POSIX: _POSIX_C_SOURCE or _GNU_SOURCE.
 */
#ifndef FCSL_MONOTONIC_H
#define FCSL_MONOTONIC_H

#include <stdint.h>
#include <time.h>

#include "fcsl/fcsl_tick_time.h"

static inline uint64_t fcsl_monotonic_ns(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * FCSL_NS_PER_S + (uint64_t)now.tv_nsec;
}

static inline struct timespec fcsl_timespec_of(uint64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / FCSL_NS_PER_S), .tv_nsec = (long)(ns % FCSL_NS_PER_S)};
}

/* How long it is until `deadline_ns`. */
static inline struct timespec fcsl_time_left(uint64_t deadline_ns)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    return fcsl_timespec_of(deadline_ns > now_ns ? deadline_ns - now_ns : 0u);
}

/* Sleeps until then, or until a signal. */
static inline void fcsl_monotonic_wait(uint64_t until_ns)
{
    const struct timespec until = fcsl_timespec_of(until_ns);
    (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

#endif /* FCSL_MONOTONIC_H */
