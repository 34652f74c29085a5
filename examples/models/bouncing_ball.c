/* SPDX-License-Identifier: Apache-2.0
 *
 * A ball in free fall that bounces on the ground:
 *
 *   height'' = -gravity;   at the ground:  speed = -restitution speed
 *
 * Below `rest_speed` it does not leave the ground again. Without this limit it would bounce without end in finite time.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double gravity, restitution, rest_speed, height, speed;
    } parameters;
    struct {
        double height, speed; /* integrated */
        bool resting;
        uint32_t bounces;
    } state;
    struct {
        double height, speed;
        bool resting;
        uint32_t bounces;
    } outputs;
} bouncing_ball_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    bouncing_ball_t *ball = self;
    (void)context;
    if (!(ball->parameters.gravity > 0.0)) {
        return "parameters.gravity must be positive";
    }
    if (!(ball->parameters.restitution >= 0.0 && ball->parameters.restitution <= 1.0)) {
        return "parameters.restitution must be in [0, 1]";
    }
    if (!(ball->parameters.rest_speed > 0.0)) {
        return "parameters.rest_speed must be positive";
    }
    if (!(ball->parameters.height > 0.0)) {
        return "parameters.height must be positive";
    }
    ball->state.height = ball->parameters.height;
    ball->state.speed = ball->parameters.speed;
    ball->state.resting = false;
    ball->state.bounces = 0;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const bouncing_ball_t *ball = self;
    (void)t;
    dx[0] = ball->state.resting ? 0.0 : x[1];
    dx[1] = ball->state.resting ? 0.0 : -ball->parameters.gravity;
}

static void output(void *self, double t, const double *x)
{
    bouncing_ball_t *ball = self;
    (void)t;
    ball->outputs.height = x[0];
    ball->outputs.speed = x[1];
    ball->outputs.resting = ball->state.resting;
    ball->outputs.bounces = ball->state.bounces;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const bouncing_ball_t *ball = self;
    (void)t;
    value[0] = ball->state.resting ? 1.0 : x[0];
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    bouncing_ball_t *ball = self;
    (void)context, (void)number;
    const double speed = -ball->parameters.restitution * ball->state.speed;
    ball->state.resting = speed < ball->parameters.rest_speed;
    ball->state.height = 0.0;
    ball->state.speed = ball->state.resting ? 0.0 : speed;
    ball->state.bounces++;
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(bouncing_ball_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(PARAMETER, parameters.gravity, "m/s^2", ""),
    FIELD(PARAMETER, parameters.restitution, "", "speed after a bounce by speed before it"),
    FIELD(PARAMETER, parameters.rest_speed, "m/s", "slower than this after a bounce, it stays on the ground"),
    FIELD(PARAMETER, parameters.height, "m", "at the start"),
    FIELD(PARAMETER, parameters.speed, "m/s", "at the start, up"),
    FIELD(STATE, state.height, "m", ""),
    FIELD(STATE, state.speed, "m/s", ""),
    FIELD(STATE, state.resting, "", ""),
    FIELD(STATE, state.bounces, "", ""),
    FIELD(OUTPUT, outputs.height, "m", "of its lowest point"),
    FIELD(OUTPUT, outputs.speed, "m/s", "up"),
    FIELD(OUTPUT, outputs.resting, "", "it lies on the ground"),
    FIELD(OUTPUT, outputs.bounces, "", "so far"),
};

static const fcsl_model_event_t events[] = {{"bounce", FCSL_FALLING, "it touches the ground"}};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "bouncing_ball",
    .doc = "a ball that bounces until it rests",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(bouncing_ball_t),
    .align = _Alignof(bouncing_ball_t),
    .continuous_offset = offsetof(bouncing_ball_t, state),
    .continuous_count = 2,
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = sizeof events / sizeof *events,
    .init = init,
    .derivative = derivative,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
