/* SPDX-License-Identifier: Apache-2.0 */
#include "bodies.h"

#include "bench_plant.h"

PLANT(bodies)

static const char *init(void *self, const fcsl_model_context_t *context)
{
    bodies_t *bodies = self;
    (void)context;
    memcpy(bodies->state.x, bodies->parameters.x, sizeof bodies->state.x);
    return NULL;
}

static const fcsl_field_t fields[] = {VECTOR(bodies, mu, ""), VECTOR(bodies, x, ""), STATES(bodies)};

static const fcsl_model_t model = {PLANT_MEMBERS(bodies, "three bodies that attract each other")};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
