/* SPDX-License-Identifier: Apache-2.0 */
#include "lander.h"

#include "bench_plant.h"

PLANT(lander)
PLANT_EVENTS(lander)

static const char *init(void *self, const fcsl_model_context_t *context)
{
    lander_t *lander = self;
    (void)context;
    lander->state.x[0] = lander->parameters.height;
    lander->state.x[2] = lander->parameters.dry_mass + lander->parameters.fuel_mass;
    return NULL;
}

static const fcsl_field_t fields[] = {
    SCALAR(lander, dry_mass, "kg"),   SCALAR(lander, fuel_mass, "kg"),
    SCALAR(lander, max_thrust, "N"),  SCALAR(lander, isp, "s"),
    SCALAR(lander, gravity, "m/s^2"), SCALAR(lander, height, "m"),
    SCALAR(lander, throttle, ""),     STATES(lander),
};

static const fcsl_model_event_t events[LANDER_EVENTS] = {
    [LANDER_TOUCHDOWN] = {"touchdown", FCSL_FALLING, ""},
    [LANDER_LIFT_OFF] = {"lift_off", FCSL_RISING, ""},
    [LANDER_BURNOUT] = {"burnout", FCSL_FALLING, ""},
};

static const fcsl_model_t model = {
    PLANT_MEMBERS(lander, "vertical flight with a constant throttle"),
    .events = events,
    .event_count = LANDER_EVENTS,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
