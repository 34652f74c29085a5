/* SPDX-License-Identifier: Apache-2.0
 *
 * One tick with the hosted or the connected controller.
 */
#ifndef FCSL_SIM_EXCHANGE_H
#define FCSL_SIM_EXCHANGE_H

#include "engine/simulation.h"

/* Returns 0, or -1. */
int fcsl_sim_tick_once(fcsl_sim_t *sim, fcsl_error_t *error);

#endif /* FCSL_SIM_EXCHANGE_H */
