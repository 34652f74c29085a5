/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated time is an integer: nanoseconds since the start of the run. Rates share one grid, so that events that
 * happen together have exactly the same time.
 */
#ifndef FCSL_SIM_CLOCK_H
#define FCSL_SIM_CLOCK_H

#include <stdint.h>

#include "fcsl/fcsl_tick_time.h"

/* Time of step `step` of a grid of `hz` (at most 1e9): floor(step * 1e9 / hz), never accumulated. The remainder is below
 * hz, so no product overflows before the result itself would. */
static inline int64_t fcsl_grid_time_ns(uint64_t step, uint64_t hz)
{
    return (int64_t)((step / hz) * FCSL_NS_PER_S + (step % hz) * FCSL_NS_PER_S / hz);
}

#endif /* FCSL_SIM_CLOCK_H */
