/* SPDX-License-Identifier: Apache-2.0
 *
 * From instant to instant.
 */
#ifndef FCSL_SIM_INSTANTS_H
#define FCSL_SIM_INSTANTS_H

#include "simulation.h"

/* Goes to the next instant and does all that is due but for the controller's tick; *ticked: whether that is due. Returns 0, or -1. */
int fcsl_sim_next_instant(fcsl_sim_t *sim, int *ticked, fcsl_error_t *error);
/* Returns 0, or -1: the queue is full. */
int fcsl_sim_schedule_tick(fcsl_sim_t *sim, uint64_t tick);
/* The next events of a simulation between two ticks, from its instances. */
void fcsl_sim_refill_queue(fcsl_sim_t *sim);
/* Something besides the plant itself has changed a value of an instance: its group sees it at its next step. */
void fcsl_sim_disturb(fcsl_sim_t *sim, uint32_t instance);
/* After a model has run: a mode that it left would change the bits of all others. */
int fcsl_sim_check_fp_mode(const char *caller, fcsl_error_t *error);

#endif /* FCSL_SIM_INSTANTS_H */
