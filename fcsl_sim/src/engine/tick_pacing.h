/* SPDX-License-Identifier: Apache-2.0
 *
 * When ticks may run.
 */
#ifndef FCSL_SIM_TICK_PACING_H
#define FCSL_SIM_TICK_PACING_H

#include "simulation.h"

/* The time of the monotonic clock to wait for, at most a short while ahead even if the next tick is due later. 0 if
 * it is due. */
uint64_t fcsl_sim_wait_until(fcsl_sim_t *sim);
/* Sleeps until then, or until a signal. */
void fcsl_sim_sleep_until(uint64_t deadline_ns);
/* A simulation that is late by more than 0.1 s does not make up for it. */
void fcsl_sim_forgive(fcsl_sim_t *sim);
/* The next tick is due at once, later ones relative to it. */
void fcsl_sim_pace_anew(fcsl_sim_t *sim);

#endif /* FCSL_SIM_TICK_PACING_H */
