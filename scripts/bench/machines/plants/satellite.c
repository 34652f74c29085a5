/* SPDX-License-Identifier: Apache-2.0 */
#include "satellite.h"

#include "bench_plant.h"

PLANT(satellite)

static const char *init(void *self, const fcsl_model_context_t *context)
{
    satellite_t *satellite = self;
    (void)context;
    memcpy(satellite->state.x, satellite->parameters.x, sizeof satellite->state.x);
    return NULL;
}

static const fcsl_field_t fields[] = {
    SCALAR(satellite, mu, "m^3/s^2"),
    VECTOR(satellite, inertia, "kg*m^2"),
    VECTOR(satellite, x, ""),
    STATES(satellite),
};

static const fcsl_model_t model = {PLANT_MEMBERS(satellite, "a rigid body in orbit")};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
