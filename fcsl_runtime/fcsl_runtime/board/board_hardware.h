/* SPDX-License-Identifier: Apache-2.0
 *
 * What the hw_* builtins of algorithms reach on a board: pins and converters of devices, and registers. No pin and no converter is waited
 * for: a read gives what the device's thread had read when the tick began, and levels go to the device's thread at the end of the
 * tick. Registers are memory.
 */
#ifndef BOARD_BOARD_HARDWARE_H
#define BOARD_BOARD_HARDWARE_H

#include "board_devices.h"
#include "fcsl/fcsl_hw.h"

typedef struct board_hardware board_hardware_t;

/* Finds drivers and signals; opens nothing. `plan` and `inputs` must outlive it. Null with `error`. */
board_hardware_t *board_hardware_new(const board_plan_t *plan, board_devices_t *inputs, fcsl_error_t *error);
/* Opens the devices of outputs, which get their safe levels, and maps registers. Threads have this priority of SCHED_FIFO (0: as any
 * thread). 0, or -1. */
int board_hardware_start(board_hardware_t *hardware, int priority, fcsl_error_t *error);
/* After each tick, and while the flight is paused: hands the levels of all outputs to their devices, the same ones again, too, for a device
 * that did not take them. */
void board_hardware_tick(board_hardware_t *hardware);
/* For the step thread. Lasts as long as the hardware. */
const struct fcsl_hw *board_hardware_table(const board_hardware_t *hardware);
/* Whether it drives the device of the plan, and its counts then. */
int board_hardware_counts(const board_hardware_t *hardware, uint32_t device, device_counts_t *counts);
/* Of any output, since the last call: a text for people, or null. */
const char *board_hardware_news(board_hardware_t *hardware);
/* The last levels are the safe ones: tried again and again for 1 s. 0, or -1: a device has not taken them. */
int board_hardware_end(board_hardware_t *hardware, fcsl_error_t *error);
/* Ends, if that was not done, and closes all. Devices that hang are left alone after another second. */
void board_hardware_free(board_hardware_t *hardware);

#endif /* BOARD_BOARD_HARDWARE_H */
