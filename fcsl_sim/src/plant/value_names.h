/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of values within models, and the search for one that is no number.
 */
#ifndef FCSL_SIM_VALUE_NAMES_H
#define FCSL_SIM_VALUE_NAMES_H

#include "plant.h"

/* The field at an offset in the struct of an instance: "lander.state.pos_z", "wheel.state.rate[2]". */
#define FCSL_VALUE_NAME_BYTES 320u
void fcsl_sim_name_value(const fcsl_instance_state_t *instance, size_t offset, char *text, size_t size);
/* Fails where an output of an instance is not finite. */
int fcsl_sim_check_outputs(const fcsl_plant_t *plant, fcsl_error_t *error);

#endif /* FCSL_SIM_VALUE_NAMES_H */
