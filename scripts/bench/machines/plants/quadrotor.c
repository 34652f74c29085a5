/* SPDX-License-Identifier: Apache-2.0 */
#include "quadrotor.h"

#include "bench_plant.h"

PLANT(quadrotor)

static const char *init(void *self, const fcsl_model_context_t *context)
{
    quadrotor_t *quadrotor = self;
    (void)context;
    quadrotor->state.x[6] = 1.0;
    return NULL;
}

static const fcsl_field_t fields[] = {
    SCALAR(quadrotor, mass, "kg"),
    SCALAR(quadrotor, gravity, "m/s^2"),
    SCALAR(quadrotor, arm, "m"),
    SCALAR(quadrotor, yaw, "m"),
    SCALAR(quadrotor, drag, "kg/s"),
    SCALAR(quadrotor, turning_drag, "N*m*s/rad"),
    VECTOR(quadrotor, inertia, "kg*m^2"),
    VECTOR(quadrotor, thrust, "N"),
    STATES(quadrotor),
};

static const fcsl_model_t model = {PLANT_MEMBERS(quadrotor, "a quadrotor with constant thrusts")};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
