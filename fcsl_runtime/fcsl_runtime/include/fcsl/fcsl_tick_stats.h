/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick loop counts and times. The step thread writes, with plain loads and stores; any thread reads it in place,
 * so readers cost the step thread nothing.
 */
#ifndef FCSL_TICK_STATS_H
#define FCSL_TICK_STATS_H

#include "fcsl/fcsl_machine.h"
#include "fcsl/fcsl_histogram.h"

/* All zero before the first tick. Durations are ns. */
typedef struct {
    _Atomic uint64_t ticks;
    _Atomic uint64_t deadlines_missed; /* whose successor came before their tick began, or that got none */
    _Atomic uint64_t ticks_skipped; /* deadlines that got no tick */
    _Atomic uint64_t messages_refused;
    _Atomic uint64_t hardware_failures;
    _Atomic uint64_t records_dropped;
    fcsl_histogram_t lateness; /* how long after a deadline the loop came to it; of ticks that the clock paces */
    fcsl_histogram_t tick_time; /* from the sensors' sample to the end of the tick's work */

    _Atomic uint64_t tick;     /* the number of the tick that runs or was last */
    _Atomic uint64_t begun_ns; /* when the tick that now runs began, by the monotonic clock; 0 between ticks */
    _Atomic uint64_t watchdog_trips; /* ticks that took longer than the watchdog allows; written by its thread */
} fcsl_tick_stats_t;

static inline uint64_t fcsl_tick_stats_get(const _Atomic uint64_t *number)
{
    return atomic_load_explicit(number, memory_order_relaxed);
}

/* From the one thread that writes this number. */
static inline void fcsl_tick_stats_put(_Atomic uint64_t *number, uint64_t value)
{
    atomic_store_explicit(number, value, memory_order_relaxed);
}

/* Faults and overruns of all instances: the machine counts them itself. `data` is a machine struct, of a publication of the
 * history say. */
void fcsl_tick_stats_faults(const fcsl_machine_t *machine, const uint8_t *data, uint64_t *faults, uint64_t *overruns);

#endif /* FCSL_TICK_STATS_H */
