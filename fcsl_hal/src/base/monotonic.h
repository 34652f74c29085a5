/* SPDX-License-Identifier: Apache-2.0
 *
 * CLOCK_MONOTONIC in nanoseconds.
 */
#ifndef FCSL_MONOTONIC_H
#define FCSL_MONOTONIC_H

#include <stdint.h>
#include <time.h>

enum { NS_PER_MS = 1000000, NS_PER_S = 1000000000 };

static inline uint64_t monotonic_ns(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * NS_PER_S + (uint64_t)now.tv_nsec;
}

static inline struct timespec timespec_of(uint64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)};
}

/* How long it is until `deadline_ns`. */
static inline struct timespec time_left(uint64_t deadline_ns)
{
    const uint64_t now_ns = monotonic_ns();
    return timespec_of(deadline_ns > now_ns ? deadline_ns - now_ns : 0u);
}

/* Sleeps until then, or until a signal. */
static inline void monotonic_wait(uint64_t until_ns)
{
    const struct timespec until = timespec_of(until_ns);
    (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

#endif /* FCSL_MONOTONIC_H */
