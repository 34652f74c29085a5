/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulation behind the variable server.
 */
#ifndef FCSL_SIM_VARIABLE_SERVER_H
#define FCSL_SIM_VARIABLE_SERVER_H

#include "engine/simulation.h"

/* Executes a waiting command; waits a while and returns 0 if no tick may run now. */
int fcsl_sim_serve_clients(fcsl_sim_t *sim);
void fcsl_sim_end_service(fcsl_sim_t *sim);

#endif /* FCSL_SIM_VARIABLE_SERVER_H */
