/* SPDX-License-Identifier: Apache-2.0
 *
 * A controller in another process.
 */
#ifndef FCSL_SIM_EXTERNAL_CONTROLLER_H
#define FCSL_SIM_EXTERNAL_CONTROLLER_H

#include "engine/simulation.h"

/* Says what became of a message to or from the external controller; returns -1. */
int fcsl_sim_external_failed(const fcsl_sim_t *sim, fcsl_hal_status_t status, const char *doing, fcsl_error_t *error);

#endif /* FCSL_SIM_EXTERNAL_CONTROLLER_H */
