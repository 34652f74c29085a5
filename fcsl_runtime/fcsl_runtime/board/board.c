/* SPDX-License-Identifier: Apache-2.0
 *
 * The sensors of a board.
 */
#include "board.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"

static int open_sensors(board_t *board, const char *file, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = board->run != NULL ? fcsl_run_machine(board->run) : NULL;
    board->plan = board_plan_read(file, error);
    if (board->plan == NULL || (machine != NULL && board_plan_check_machine(board->plan, file, machine, error) != 0)) {
        return -1;
    }
    for (uint32_t s = 0; s < board->plan->sensor_count; s++) {
        if (board_sensor_open(&board->sensors[s], &board->plan->sensors[s], machine, error) != 0) {
            return -1;
        }
    }
    return 0;
}

board_t *board_open(const char *file, fcsl_run_t *run, fcsl_error_t *error)
{
    board_t *board = calloc(1, sizeof *board);
    if (board == NULL) {
        (void)fcsl_fail(error, "out of memory for the board");
        return NULL;
    }
    board->run = run;
    if (open_sensors(board, file, error) != 0) {
        board_close(board);
        return NULL;
    }
    return board;
}

void board_take(board_t *board, uint32_t sensor, const fcsl_reading_t *reading)
{
    if (sensor < board->plan->sensor_count) {
        fcsl_frontend_take(board->sensors[sensor].frontend, reading);
    }
}

int board_tick(board_t *board, uint64_t now_ns, fcsl_error_t *error)
{
    for (uint32_t s = 0; s < board->plan->sensor_count; s++) {
        if (board_sensor_tick(&board->sensors[s], board->run, now_ns, error) != 0) {
            return -1;
        }
    }
    return 0;
}

const fcsl_frontend_output_t *board_output(const board_t *board, uint32_t sensor)
{
    return &board->sensors[sensor].output;
}

fcsl_backend_condition_t board_condition(const board_t *board, uint32_t sensor, uint32_t backend)
{
    return fcsl_frontend_condition(board->sensors[sensor].frontend, backend);
}

const board_plan_t *board_plan(const board_t *board)
{
    return board->plan;
}

void board_close(board_t *board)
{
    if (board == NULL) {
        return;
    }
    for (uint32_t s = 0; s < BOARD_SENSORS_MAX; s++) {
        board_sensor_close(&board->sensors[s]);
    }
    board_plan_free(board->plan);
    free(board);
}
