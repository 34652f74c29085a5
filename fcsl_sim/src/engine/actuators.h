/* SPDX-License-Identifier: Apache-2.0
 *
 * What the actuators get: the state of the gate before them (fcsl_gate.h), and the values that it lets through.
 */
#ifndef FCSL_SIM_ACTUATORS_H
#define FCSL_SIM_ACTUATORS_H

#include "simulation.h"

/* Closes the gate. For a machine that arms or has a time-out, makes sim->actuators: a table of the outputs `gate` and one for
 * each actuator channel, named like it, and their values. Returns 0, or -1. */
int fcsl_actuators_build(fcsl_sim_t *sim, fcsl_error_t *error);
void fcsl_actuators_free(fcsl_sim_t *sim);
/* Brings the values of sim->actuators up to date. */
void fcsl_actuators_update(fcsl_sim_t *sim);

#endif /* FCSL_SIM_ACTUATORS_H */
