/* SPDX-License-Identifier: Apache-2.0
 *
 * The readings of a tick, before the frontends: kept, and recorded as a topic of the bag. From them a replay computes again what the
 * machine got.
 */
#ifndef BOARD_READINGS_H
#define BOARD_READINGS_H

#include "board_devices.h"

enum { READINGS_MAX = 512 }; /* of a tick; board_devices_take says what becomes of more */

typedef struct {
    sensor_reading_t kept[READINGS_MAX];
    uint32_t count;
    int topic; /* -1: they are not recorded */
    uint8_t *cdr;
    uint32_t values[BOARD_SENSORS_MAX]; /* of a reading, by sensor */
    const board_plan_t *plan;
    int named; /* the names of the plan are recorded */
} readings_t;

/* The topic `<name_space>/readings` of the run's recording, for the sensors of the plan. 0, or -1. */
int readings_record(readings_t *readings, const board_plan_t *plan, fcsl_run_t *run, const char *name_space,
                    fcsl_error_t *error);
/* Records those of the coming tick, for which the frontends judge at `now_ns`, and forgets them. */
void readings_end_tick(readings_t *readings, fcsl_run_t *run, uint64_t now_ns);
void readings_free(readings_t *readings);

#endif /* BOARD_READINGS_H */
