/* SPDX-License-Identifier: Apache-2.0
 *
 * The sensors of a board, apart from its devices: readings in, samples of the machine's channels out. In flight the readings come from
 * devices (hal_linux.c), in a replay from a bag.
 */
#ifndef BOARD_BOARD_H
#define BOARD_BOARD_H

#include "board_sensor.h"

typedef struct {
    fcsl_run_t *run;
    board_plan_t *plan;
    board_sensor_run_t sensors[BOARD_SENSORS_MAX];
} board_t;

/* Reads the plan, which must be for the machine of `run`; null: for any, and nobody gets the values. Returns a board for board_close, or
 * null. */
board_t *board_open(const char *file, fcsl_run_t *run, fcsl_error_t *error);
/* A reading of a sensor's backend, before the tick that it is for. */
void board_take(board_t *board, uint32_t sensor, const fcsl_reading_t *reading);
/* Gives the sensor channels of the coming tick what is new. 0, or -1. */
int board_tick(board_t *board, uint64_t now_ns, fcsl_error_t *error);
/* What a sensor gave in the last tick, and the condition of its backends. */
const fcsl_frontend_output_t *board_output(const board_t *board, uint32_t sensor);
fcsl_backend_condition_t board_condition(const board_t *board, uint32_t sensor, uint32_t backend);
const board_plan_t *board_plan(const board_t *board);
void board_close(board_t *board);

#endif /* BOARD_BOARD_H */
