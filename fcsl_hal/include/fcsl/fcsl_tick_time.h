/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_TICK_TIME_H
#define FCSL_TICK_TIME_H

#include <stdint.h>

/* Time of tick k: floor(k * 1e9 / tick_hz) ns, exact for every k that fits. tick_hz: 1 to 1e9. */
static inline uint64_t fcsl_tick_time_ns(uint64_t tick_hz, uint64_t tick)
{
    /* Whole seconds and the rest apart: neither product overflows. */
    return tick / tick_hz * 1000000000u + tick % tick_hz * 1000000000u / tick_hz;
}

#endif /* FCSL_TICK_TIME_H */
