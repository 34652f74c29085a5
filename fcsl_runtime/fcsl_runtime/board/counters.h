/* SPDX-License-Identifier: Apache-2.0
 *
 * What stands under `hal.` in a flight with a board: for each sensor its primary and the condition of its devices, for each device what
 * its thread counts.
 */
#ifndef BOARD_COUNTERS_H
#define BOARD_COUNTERS_H

#include "board_plan.h"

typedef struct {
    fcsl_field_t *fields;
    uint64_t *values; /* one per field, in the order of `fields` */
    uint32_t count;
    char *texts; /* the paths */
} counters_t;

/* For each sensor `sensors.<sensor>.primary` and `sensors.<sensor>.condition.<device>`; then for each device `devices.<device>.open`,
 * `samples`, `errors`, `dropped`, `lost`, `bytes`, `frames`, `rejected`, `why`. 0, or -1. */
int counters_open(counters_t *counters, const board_plan_t *plan, fcsl_error_t *error);
void counters_free(counters_t *counters);

#endif /* BOARD_COUNTERS_H */
