/* SPDX-License-Identifier: Apache-2.0
 *
 * Whether a model keeps the rules of fcsl_model.h.
 */
#ifndef FCSL_SIM_MODEL_CONTRACT_H
#define FCSL_SIM_MODEL_CONTRACT_H

#include "plant.h"

/* Tries the functions of an instance that is initialised. Returns 0, or -1. */
int fcsl_sim_check_contract(fcsl_plant_t *plant, uint32_t index, fcsl_error_t *error);

#endif /* FCSL_SIM_MODEL_CONTRACT_H */
