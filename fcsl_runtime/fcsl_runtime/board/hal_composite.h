/* SPDX-License-Identifier: Apache-2.0
 *
 * The composite HAL: some sensors are a board's, all others are a simulator's, and the commands go to the simulator, too (docs/hardware/hal.md).
 * Real devices do not wait: the simulator must keep real time.
 */
#ifndef BOARD_HAL_COMPOSITE_H
#define BOARD_HAL_COMPOSITE_H

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"

/* `board`: of hal_linux, for the machine of `run`; `simulated`: of a wire or the bus. The composite owns both, also when it fails. 0, or
 * -1. */
int hal_composite(const fcsl_hal_t *board, const fcsl_hal_t *simulated, fcsl_run_t *run, fcsl_hal_t *hal,
                  fcsl_error_t *error);

#endif /* BOARD_HAL_COMPOSITE_H */
