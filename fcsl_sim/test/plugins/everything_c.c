/* SPDX-License-Identifier: Apache-2.0
 *
 * A model with a field of each type and shape, and with every function. everything_cpp.cpp and everything_rust are the
 * same model.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double wind[3];
        int32_t count;
        bool enabled;
    } inputs;
    struct {
        float gain[2][3];
        uint64_t limit;
        int64_t identity;
        double curve[4];
    } parameters;
    struct {
        double position, speed; /* integrated */
        uint32_t updates, last_event;
    } state;
    struct {
        double value, sample[2];
        bool sampled;
    } outputs;
} everything_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    everything_t *m = self;
    if (m->parameters.limit == 0) {
        return "parameters.limit must not be 0";
    }
    m->state.position = 1.0 + (double)context->time_ns;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const everything_t *m = self;
    dx[0] = x[1];
    dx[1] = m->inputs.wind[0] - x[0] + (double)m->parameters.gain[1][2] * t;
}

static void output(void *self, double t, const double *x)
{
    everything_t *m = self;
    m->outputs.value = m->inputs.wind[2] + cr_sin(x[0]) + sqrt(t);
}

static void update(void *self, const fcsl_model_context_t *context)
{
    everything_t *m = self;
    m->state.updates++;
    m->outputs.sample[0] = context->gaussian(context->noise, 1);
    m->outputs.sample[1] = context->uniform(context->noise, 2);
    m->outputs.sampled = m->inputs.enabled;
}

static void event(const void *self, double t, const double *x, double *value)
{
    (void)self;
    value[0] = x[0];
    value[1] = t - 1.0;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    everything_t *m = self;
    (void)context;
    m->state.speed = -m->state.speed;
    m->state.last_event = number;
}

static double next_time(const void *self, double t)
{
    const everything_t *it = self;
    return t + (double)it->parameters.identity;
}

#define FIELD(kind, role, path, unit, doc) FCSL_MODEL_##kind(everything_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(VECTOR, INPUT, inputs.wind, "m/s", "of the air"),
    FIELD(SCALAR, OPTIONAL_INPUT, inputs.count, "", ""),
    FIELD(SCALAR, INPUT, inputs.enabled, "", ""),
    FIELD(MATRIX, PARAMETER, parameters.gain, "", "two rows of three"),
    FIELD(SCALAR, PARAMETER, parameters.limit, "", ""),
    FIELD(SCALAR, OPTIONAL_PARAMETER, parameters.identity, "", ""),
    FIELD(VECTOR, TABLE, parameters.curve, "N", ""),
    FIELD(SCALAR, STATE, state.position, "m", ""),
    FIELD(SCALAR, STATE, state.speed, "m/s", ""),
    FIELD(SCALAR, STATE, state.updates, "", ""),
    FIELD(SCALAR, STATE, state.last_event, "", ""),
    FIELD(SCALAR, FEEDTHROUGH, outputs.value, "m", ""),
    FIELD(VECTOR, OUTPUT, outputs.sample, "", "of noise"),
    FIELD(SCALAR, OUTPUT, outputs.sampled, "", ""),
};

static const fcsl_model_event_t events[] = {
    {"ground", FCSL_FALLING, "the position becomes negative"},
    {"second", FCSL_EITHER, ""},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "everything_c",
    .doc = "every function, every type",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(everything_t),
    .align = _Alignof(everything_t),
    .continuous_offset = offsetof(everything_t, state),
    .continuous_count = 2,
    .is_second_order = 1,
    .sampled_offset = offsetof(everything_t, outputs.sampled),
    .events = events,
    .event_count = sizeof events / sizeof *events,
    .init = init,
    .derivative = derivative,
    .output = output,
    .update = update,
    .event = event,
    .reset = reset,
    .next_time = next_time,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
