/* SPDX-License-Identifier: Apache-2.0
 *
 * All that a simulation needs to go on, besides the first machine and its hardware, as bytes: models, noise, integrators, events,
 * channels, gates, delays, the line, companions. Between two ticks.
 */
#ifndef FCSL_SIM_PLANT_STATE_H
#define FCSL_SIM_PLANT_STATE_H

#include "engine/simulation.h"

size_t fcsl_plant_state_bytes(const fcsl_sim_t *sim);
void fcsl_plant_state_save(const fcsl_sim_t *sim, void *bytes);
/* `structs_alone`: without what the requirements of companions remember, as format version 1 of checkpoints is. Returns 0, or -1:
 * the size is another one, or a machine has refused its part, and the simulation is of no use until another one is restored. */
int fcsl_plant_state_restore(fcsl_sim_t *sim, const void *bytes, size_t size, int structs_alone);

#endif /* FCSL_SIM_PLANT_STATE_H */
