/* SPDX-License-Identifier: Apache-2.0
 *
 * The plant's outputs as ROS 2 messages.
 */
#ifndef FCSL_SIM_MODEL_MESSAGES_H
#define FCSL_SIM_MODEL_MESSAGES_H

#include "engine/simulation.h"

/* Type, schema and size of every instance's message, and of the actuators'. */
int fcsl_model_messages_build(fcsl_sim_t *sim, fcsl_error_t *error);
void fcsl_model_messages_free(fcsl_sim_t *sim);
/* The outputs as CDR, stamped with a time. Returns its bytes, or 0 when it does not fit. */
size_t fcsl_model_message_write(int64_t time_ns, const fcsl_instance_state_t *instance, uint8_t *cdr_bytes,
                                size_t capacity);

#endif /* FCSL_SIM_MODEL_MESSAGES_H */
