/* SPDX-License-Identifier: Apache-2.0
 *
 * The HAL of a board: sensors are devices of this computer, read through drivers and frontends as a plan says (docs/hardware/hal.md). Actuators
 * are fcsl-guard's: without one, commands move nothing.
 */
#ifndef BOARD_HAL_LINUX_H
#define BOARD_HAL_LINUX_H

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"

/* `file`: the plan that `fcsl board` has written, for the machine of `run`; `priority`: of the devices' threads, with SCHED_FIFO (0: as any
 * thread). 0, or -1. */
int hal_linux(const char *file, int priority, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error);
/* After the last tick: makes pins safe. 0, or -1: one is not. */
int hal_linux_end(const fcsl_hal_t *hal, fcsl_error_t *error);
/* Whether a sensor of the board gives this channel of the machine its samples. */
int hal_linux_feeds(const fcsl_hal_t *hal, uint32_t channel);
/* Records the readings of the devices with the run, which is being recorded (readings.h). 0, or -1. */
int hal_linux_record(const fcsl_hal_t *hal, const char *name_space, fcsl_error_t *error);

#endif /* BOARD_HAL_LINUX_H */
