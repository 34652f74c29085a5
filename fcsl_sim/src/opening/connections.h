/* SPDX-License-Identifier: Apache-2.0
 *
 * The connections of the plan.
 */
#ifndef FCSL_SIM_CONNECTIONS_H
#define FCSL_SIM_CONNECTIONS_H

#include "engine/simulation.h"

int fcsl_sim_build_connections(fcsl_sim_t *sim, fcsl_error_t *error);

#endif /* FCSL_SIM_CONNECTIONS_H */
