/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_TICK_TIME_H
#define FCSL_TICK_TIME_H

#include <stdint.h>

enum { FCSL_NS_PER_MS = 1000000, FCSL_NS_PER_S = 1000000000 };

/* Time of tick k: floor(k * 1e9 / tick_hz) ns, exact for every k that fits. tick_hz: 1 to 1e9. */
static inline uint64_t fcsl_tick_time_ns(uint64_t tick_hz, uint64_t tick)
{
    /* Whole seconds and the rest apart: neither product overflows. */
    return tick / tick_hz * 1000000000u + tick % tick_hz * 1000000000u / tick_hz;
}

/* Whole ticks that last this many nanoseconds; UINT32_MAX when there are more. tick_hz: 1 to 1e9. */
static inline uint32_t fcsl_ticks_of(uint64_t tick_hz, uint64_t duration_ns)
{
    const uint64_t seconds = duration_ns / 1000000000u;
    const uint64_t rest = duration_ns % 1000000000u;
    if (seconds > UINT32_MAX) {
        return UINT32_MAX; /* more than a hundred years, at 1 Hz */
    }
    const uint64_t ticks = seconds * tick_hz + rest * tick_hz / 1000000000u;
    return ticks < UINT32_MAX ? (uint32_t)ticks : UINT32_MAX;
}

#endif /* FCSL_TICK_TIME_H */
