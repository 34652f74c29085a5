/* SPDX-License-Identifier: Apache-2.0
 *
 * A bouncing ball: z'' = -gravity; the ground returns `restitution` of the speed. Slower than `rest_speed` it stays down.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double push;
    } inputs;
    struct {
        double gravity, restitution, rest_speed, height;
    } parameters;
    struct {
        double z, v;
        bool at_rest;
        int64_t bounces, last_bounce_ns;
    } state;
    struct {
        double z, v;
        int64_t bounces, last_bounce_ns;
    } outputs;
} ball_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    ball_t *ball = self;
    (void)context;
    ball->state.z = ball->parameters.height;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const ball_t *ball = self;
    (void)t;
    dx[0] = ball->state.at_rest ? 0.0 : x[1];
    dx[1] = ball->state.at_rest ? 0.0 : ball->inputs.push - ball->parameters.gravity;
}

static void output(void *self, double t, const double *x)
{
    ball_t *ball = self;
    (void)t;
    ball->outputs.z = x[0];
    ball->outputs.v = x[1];
    ball->outputs.bounces = ball->state.bounces;
    ball->outputs.last_bounce_ns = ball->state.last_bounce_ns;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const ball_t *ball = self;
    (void)t;
    value[0] = ball->state.at_rest ? 1.0 : x[0];
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    ball_t *ball = self;
    (void)number;
    ball->state.z = 0.0;
    ball->state.v = -ball->parameters.restitution * ball->state.v;
    if (ball->state.v < ball->parameters.rest_speed) {
        ball->state.v = 0.0;
        ball->state.at_rest = true;
    }
    ball->state.bounces++;
    ball->state.last_bounce_ns = context->time_ns;
}

#define FIELD(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(ball_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.push, "m/s^2", ""),
    FIELD(PARAMETER, parameters.gravity, "m/s^2", ""),
    FIELD(PARAMETER, parameters.restitution, "", ""),
    FIELD(PARAMETER, parameters.rest_speed, "m/s", ""),
    FIELD(PARAMETER, parameters.height, "m", "at the start"),
    FIELD(STATE, state.z, "m", ""),
    FIELD(STATE, state.v, "m/s", ""),
    FIELD(STATE, state.at_rest, "", ""),
    FIELD(OUTPUT, outputs.z, "m", ""),
    FIELD(OUTPUT, outputs.v, "m/s", ""),
    FIELD(OUTPUT, outputs.bounces, "", ""),
    FIELD(OUTPUT, outputs.last_bounce_ns, "ns", ""),
};

static const fcsl_model_event_t events[] = {{"bounce", FCSL_FALLING, "the ground"}};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "ball",
    .doc = "a bouncing ball",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(ball_t),
    .align = _Alignof(ball_t),
    .continuous_offset = offsetof(ball_t, state.z),
    .continuous_count = 2,
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = 1,
    .init = init,
    .derivative = derivative,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
