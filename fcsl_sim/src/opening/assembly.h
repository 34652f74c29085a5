/* SPDX-License-Identifier: Apache-2.0
 *
 * The parts of a simulation, from its plan.
 */
#ifndef FCSL_SIM_ASSEMBLY_H
#define FCSL_SIM_ASSEMBLY_H

#include "engine/simulation.h"

/* Builds everything that the plan names, the controllers with `parameters`. The plan must be parsed, the rest zero. */
int fcsl_assembly_build(fcsl_sim_t *sim, const fcsl_parameters_t *parameters, fcsl_error_t *error);
void fcsl_assembly_free(fcsl_sim_t *sim);

#endif /* FCSL_SIM_ASSEMBLY_H */
