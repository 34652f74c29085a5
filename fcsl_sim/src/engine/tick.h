/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick in messages that need no validation.
 */
#ifndef FCSL_SIM_TICK_H
#define FCSL_SIM_TICK_H

#include "simulation.h"

/* fcsl_sim_sense and fcsl_sim_actuate without validation of messages. Each returns 0, or -1. */
int fcsl_sim_sense_message(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message,
                           fcsl_error_t *error);
int fcsl_sim_actuate_message(fcsl_sim_t *sim, const fcsl_message_t *message, fcsl_error_t *error);
/* Completes a sensed tick without an actuator message: the actuators hold what they have, until the gate's time-out. */
void fcsl_sim_hold(fcsl_sim_t *sim);
/* A command arrives at the plant. */
void fcsl_sim_take_command(void *sim, const fcsl_message_t *command);

#endif /* FCSL_SIM_TICK_H */
