/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_HARDWARE_H
#define FCSL_HARDWARE_H

#include "run_internal.h"

/* Gives the run's host its simulated hardware. */
void fcsl_hardware_init(fcsl_run_t *run);
/* Closes the board, if there is one. */
void fcsl_hardware_close(fcsl_run_t *run);

#endif /* FCSL_HARDWARE_H */
