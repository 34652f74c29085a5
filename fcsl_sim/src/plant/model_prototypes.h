/* SPDX-License-Identifier: Apache-2.0
 *
 * Whether functions of a model have the prototypes of fcsl_model.h.
 */
#ifndef FCSL_SIM_MODEL_PROTOTYPES_H
#define FCSL_SIM_MODEL_PROTOTYPES_H

#include "plant.h"

/* What `init` returned that is not null, as a text. */
const char *fcsl_sim_init_reason(const char *returned);
/* Tries whether functions of an instance take their time as a double. Returns 0, or -1. */
int fcsl_sim_check_prototypes(fcsl_plant_t *plant, uint32_t index, fcsl_error_t *error);

#endif /* FCSL_SIM_MODEL_PROTOTYPES_H */
