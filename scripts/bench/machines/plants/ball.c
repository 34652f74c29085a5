/* SPDX-License-Identifier: Apache-2.0 */
#include "ball.h"

#include "bench_plant.h"

PLANT(ball)
PLANT_EVENTS(ball)

static const char *init(void *self, const fcsl_model_context_t *context)
{
    ball_t *ball = self;
    (void)context;
    ball->state.x[0] = ball->parameters.height;
    return NULL;
}

static const fcsl_field_t fields[] = {
    SCALAR(ball, gravity, "m/s^2"),
    SCALAR(ball, restitution, ""),
    SCALAR(ball, height, "m"),
    STATES(ball),
};

static const fcsl_model_event_t events[BALL_EVENTS] = {{"bounce", FCSL_FALLING, ""}};

static const fcsl_model_t model = {
    PLANT_MEMBERS(ball, "a ball that bounces without end"),
    .events = events,
    .event_count = BALL_EVENTS,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
