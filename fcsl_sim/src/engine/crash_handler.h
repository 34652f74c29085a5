/* SPDX-License-Identifier: Apache-2.0
 *
 * Where a simulation is, for whoever finds that it crashes or hangs.
 */
#ifndef FCSL_SIM_CRASH_HANDLER_H
#define FCSL_SIM_CRASH_HANDLER_H

#include "plant/plant.h"

/* A simulation with this plant exists, or no longer. */
void fcsl_sim_is_open(const fcsl_plant_t *plant, int is_open);

#endif /* FCSL_SIM_CRASH_HANDLER_H */
