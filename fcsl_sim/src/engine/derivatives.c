/* SPDX-License-Identifier: Apache-2.0
 *
 * The right-hand side of the plant at the present, for linearisation and trim: nothing advances.
 */
#include <math.h>

#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_sim.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "plant/value_names.h"
#include "simulation.h"

static double *states_of(const fcsl_instance_state_t *instance)
{
    return (double *)(void *)(instance->data + instance->model->continuous_offset);
}

/* Inputs from models of the group alone: what a controller or a sensor feeds is the caller's. */
static void take_inner(fcsl_sim_t *sim, const fcsl_instance_state_t *instance)
{
    fcsl_plant_copy(&sim->plant, instance->first_copy + instance->outer_count, instance->inner_count);
}

uint32_t fcsl_sim_slope_count(const fcsl_sim_t *sim)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        count += sim->plant.instances[i].model->continuous_count;
    }
    return count;
}

static int compute(fcsl_sim_t *sim, double *slopes, fcsl_error_t *error)
{
    const double t = (double)sim->plant.time_ns / FCSL_NS_PER_S;
    for (uint32_t i = 0; i < sim->plant.call_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[sim->plant.calls[i].instance];
        if (sim->plant.calls[i].kind != FCSL_CALL_UPDATE) {
            take_inner(sim, instance);
            fcsl_plant_enter(&sim->plant, sim->plant.calls[i].instance, FCSL_IN_OUTPUT);
            instance->model->output(instance->data, t,
                                    instance->model->continuous_count > 0 ? states_of(instance) : NULL);
        }
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[i];
        const uint32_t count = instance->model->continuous_count;
        if (count == 0) {
            continue;
        }
        take_inner(sim, instance);
        fcsl_plant_enter(&sim->plant, i, FCSL_IN_DERIVATIVE);
        instance->model->derivative(instance->data, t, states_of(instance), slopes);
        for (uint32_t k = 0; k < count; k++) {
            if (!isfinite(slopes[k])) {
                char name[FCSL_VALUE_NAME_BYTES];
                const uint32_t offset = instance->model->continuous_offset + k * (uint32_t)sizeof(double);
                fcsl_sim_name_value(instance, offset, name, sizeof name);
                fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
                return fcsl_fail(error, "the derivative of %s is %g", name, isnan(slopes[k]) ? (double)NAN : slopes[k]);
            }
        }
        slopes += count;
    }
    fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
    return 0;
}

int fcsl_sim_slopes(fcsl_sim_t *sim, double *slopes, fcsl_error_t *error)
{
    const fcsl_fp_mode_t callers = fcsl_fp_enter();
    const int failed = compute(sim, slopes, error);
    fcsl_fp_leave(callers);
    return failed;
}
