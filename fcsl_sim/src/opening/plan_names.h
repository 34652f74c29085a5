/* SPDX-License-Identifier: Apache-2.0
 *
 * Names in lines of the plan.
 */
#ifndef FCSL_SIM_PLAN_NAMES_H
#define FCSL_SIM_PLAN_NAMES_H

#include "plant/plant.h"

/* The number of an instance; 0, or -1. */
int fcsl_sim_find_instance(const fcsl_plant_t *plant, uint32_t line, const char *name, uint32_t *index,
                           fcsl_error_t *error);
/* A field of an instance, or null. */
const fcsl_field_t *fcsl_sim_find_field(const fcsl_plant_t *plant, uint32_t line, const char *name, const char *path,
                                        uint32_t *index, fcsl_error_t *error);
/* Says what is wrong with a name in a line of the plan; returns -1. */
int fcsl_sim_fail_line(fcsl_error_t *error, uint32_t line, const char *what, const char *name);

#endif /* FCSL_SIM_PLAN_NAMES_H */
