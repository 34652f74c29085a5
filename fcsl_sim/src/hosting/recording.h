/* SPDX-License-Identifier: Apache-2.0
 *
 * The bags of a simulation.
 */
#ifndef FCSL_SIM_RECORDING_H
#define FCSL_SIM_RECORDING_H

#include "engine/simulation.h"

/* The outputs of an instance into the bag, as their message says, at the present time; 0, or -1. */
int fcsl_sim_record_model_message(fcsl_sim_t *sim, const fcsl_instance_state_t *instance,
                                  const fcsl_model_message_t *message, fcsl_error_t *error);

#endif /* FCSL_SIM_RECORDING_H */
