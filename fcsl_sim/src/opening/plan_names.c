/* SPDX-License-Identifier: Apache-2.0
 *
 * What a name in a line of the plan means.
 */
#include "plan_names.h"

#include <string.h>

#include "fcsl/fcsl_error.h"
#include "models/model.h"

int fcsl_sim_fail_line(fcsl_error_t *error, uint32_t line, const char *what, const char *name)
{
    return fcsl_fail(error, "plan line %u: %s `%s`", line, what, name);
}

int fcsl_sim_find_instance(const fcsl_plant_t *plant, uint32_t line, const char *name, uint32_t *index,
                           fcsl_error_t *error)
{
    for (uint32_t i = 0; i < plant->instance_count; i++) {
        if (strcmp(plant->instances[i].name, name) == 0) {
            *index = i;
            return 0;
        }
    }
    return fcsl_sim_fail_line(error, line, "no instance", name);
}

const fcsl_field_t *fcsl_sim_find_field(const fcsl_plant_t *plant, uint32_t line, const char *name, const char *path,
                                        uint32_t *index, fcsl_error_t *error)
{
    if (fcsl_sim_find_instance(plant, line, name, index, error)) {
        return NULL;
    }
    const fcsl_field_t *field = fcsl_model_field(plant->instances[*index].model, path);
    if (!field) {
        (void)fcsl_fail(error, "plan line %u: instance `%s` has no field `%s`", line, name, path);
    }
    return field;
}
