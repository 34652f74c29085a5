/* SPDX-License-Identifier: Apache-2.0
 *
 * Times that models announce (next_time): there a model's functions jump as functions of t. A step that reached over such a time
 * would take slopes from both sides of it for those of one smooth function, so one step ends there and another one begins. Until it
 * ends, models get times below the announced one, and from then on none below it: also where the nanosecond at which both meet is
 * rounded to another number.
 */
#include <math.h>

#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "group.h"

/* Jumps within one nanosecond. A model that announces more never comes to an end of them. */
enum { JUMPS_MAX = 1000 };

/* The earliest time that a model of the group announces, after t. */
static int ask(fcsl_group_t *group, double t, fcsl_error_t *error)
{
    fcsl_plant_t *plant = group->plant;
    group->jump_s = INFINITY;
    for (uint32_t i = 0; i < group->announcing_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->announcing[i]];
        fcsl_plant_enter(plant, group->announcing[i], FCSL_IN_NEXT_TIME);
        const double next_s = instance->model->next_time(instance->data, t);
        if (!(next_s > t)) { /* also where it is not a number */
            return fcsl_fail(error, "`next_time` of `%s` is %.17g at %.17g s: a later time, or INFINITY is wanted",
                             instance->name, next_s, t);
        }
        group->jump_s = next_s < group->jump_s ? next_s : group->jump_s;
    }
    return 0;
}

int fcsl_group_find_jump(fcsl_group_t *group, fcsl_error_t *error)
{
    group->last_s = INFINITY;
    group->jump_ns = INT64_MAX;
    if (group->announcing_count == 0) {
        return 0;
    }
    for (int i = 0; i < JUMPS_MAX; i++) {
        if (ask(group, fcsl_group_time_s(group), error)) {
            return -1;
        }
        const double ns = round(group->jump_s * FCSL_NS_PER_S);
        if (!(ns < (double)(INT64_MAX / 2))) {
            return 0;
        }
        if ((int64_t)ns > group->state.time_ns) {
            group->jump_ns = (int64_t)ns;
            group->last_s = nextafter(group->jump_s, 0.0);
            return 0;
        }
        group->state.since_s = group->jump_s;
        fcsl_group_restart(group);
    }
    return fcsl_fail(error, "a model announces more than %d jumps within the nanosecond of %.9f s", JUMPS_MAX,
                     fcsl_group_time_s(group));
}

int fcsl_group_jump(fcsl_group_t *group, fcsl_error_t *error)
{
    group->state.since_s = group->jump_s;
    group->last_s = INFINITY;
    group->jump_ns = INT64_MAX;
    return fcsl_group_resume(group, error);
}
