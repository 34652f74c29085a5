/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor of a board: its frontend, and the channels of the machine that get its values.
 */
#ifndef BOARD_BOARD_SENSOR_H
#define BOARD_BOARD_SENSOR_H

#include "board_plan.h"

typedef struct {
    uint32_t channel; /* index into the machine's */
    uint32_t at; /* in the frontend's output */
    uint32_t count;
    uint8_t type; /* FCSL_F32 or FCSL_F64 */
} board_channel_t;

typedef struct {
    board_sensor_t *plan;
    fcsl_frontend_t *frontend;
    fcsl_frontend_output_t output; /* of the last tick */
    board_channel_t channels[FCSL_QUANTITIES_MAX];
} board_sensor_run_t;

/* Finds the channels in the machine, and makes the frontend. Without a machine (null) nothing gets its values. 0, or -1. */
int board_sensor_open(board_sensor_run_t *sensor, board_sensor_t *plan, const fcsl_machine_t *machine,
                      fcsl_error_t *error);
/* Judges the backends at `now_ns`, and gives new values to the channels of the run (null: to none). 0, or -1. */
int board_sensor_tick(board_sensor_run_t *sensor, fcsl_run_t *run, uint64_t now_ns, fcsl_error_t *error);
void board_sensor_close(board_sensor_run_t *sensor);

#endif /* BOARD_BOARD_SENSOR_H */
