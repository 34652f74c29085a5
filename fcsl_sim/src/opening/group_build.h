/* SPDX-License-Identifier: Apache-2.0
 *
 * The groups of the plan.
 */
#ifndef FCSL_SIM_GROUP_BUILD_H
#define FCSL_SIM_GROUP_BUILD_H

#include "engine/simulation.h"

/* The order of calls, and the groups of models that integrate together. */
int fcsl_sim_build_groups(fcsl_sim_t *sim, fcsl_error_t *error);

#endif /* FCSL_SIM_GROUP_BUILD_H */
