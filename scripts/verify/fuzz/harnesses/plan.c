/* SPDX-License-Identifier: Apache-2.0
 *
 * plan.h: the parser of simulation plans, any bytes. What it accepts is within the limits of plan.h, names only groups that are
 * there, and is accepted again.
 */
#include <math.h>

#include "fuzz.h"
#include "plan/plan.h"

static void check_groups(const fcsl_plan_t *plan)
{
    for (uint32_t i = 0; i < plan->group_count; i++) {
        const fcsl_plan_group_t *group = &plan->groups[i];
        FUZZ_CHECK((unsigned)group->method < FCSL_METHODS && group->hz <= FCSL_PLAN_MAX_HZ);
        FUZZ_CHECK((group->hz == 0) == (group->method == FCSL_RK45));
        FUZZ_CHECK(isfinite(group->rtol) && isfinite(group->atol) && group->rtol >= 0.0 && group->atol >= 0.0);
        FUZZ_CHECK(isfinite(group->min_step_s) && isfinite(group->max_step_s) && group->min_step_s >= 0.0);
        FUZZ_CHECK(group->hz > 0 || (group->max_step_s > 0.0 && group->atol > 0.0));
    }
}

static void check_instances(const fcsl_plan_t *plan)
{
    for (uint32_t i = 0; i < plan->instance_count; i++) {
        const fcsl_plan_instance_t *instance = &plan->instances[i];
        FUZZ_CHECK(instance->group == FCSL_PLAN_NO_GROUP || instance->group < plan->group_count);
        FUZZ_CHECK(instance->hz <= FCSL_PLAN_MAX_GRID_HZ && (instance->hz > 0) == (instance->every > 0));
        FUZZ_CHECK(instance->name[0] != '\0' && instance->model[0] != '\0');
        for (uint32_t k = 0; k < i; k++) {
            FUZZ_CHECK(strcmp(instance->name, plan->instances[k].name) != 0);
        }
    }
}

static void check_others(const fcsl_plan_t *plan)
{
    FUZZ_CHECK(plan->machine.name != NULL && plan->machine.library != NULL);
    FUZZ_CHECK(plan->ticks >= 1 && plan->ticks <= FCSL_PLAN_MAX_TICKS);
    for (uint32_t i = 0; i < plan->tolerance_count; i++) {
        FUZZ_CHECK(plan->tolerances[i].atol > 0.0 && isfinite(plan->tolerances[i].atol));
    }
    for (uint32_t i = 0; i < plan->call_count; i++) {
        FUZZ_CHECK((unsigned)plan->calls[i].kind <= FCSL_CALL_UPDATE && plan->calls[i].instance[0] != '\0');
    }
    for (uint32_t i = 0; i < plan->event_count; i++) {
        FUZZ_CHECK(plan->events[i].time_ns <= INT64_MAX && plan->events[i].field[0] != '\0');
    }
    FUZZ_CHECK(plan->until == NULL || plan->until_ticks >= 1);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    fcsl_plan_t plan;
    size_t length = size;
    char *text = (char *)take_copy(&bytes, &length);
    const int failed = fcsl_plan_parse(&plan, text, length, &error);
    FUZZ_CHECK((failed != 0) == (error.text[0] != '\0'));
    if (failed == 0) {
        fcsl_plan_t again;
        check_groups(&plan);
        check_instances(&plan);
        check_others(&plan);
        FUZZ_CHECK(fcsl_plan_parse(&again, text, length, &error) == 0 && again.call_count == plan.call_count);
        fcsl_plan_free(&again);
    }
    fcsl_plan_free(&plan);
    free(text);
    return 0;
}
