/* SPDX-License-Identifier: Apache-2.0
 *
 * A sine that is added to a value, between a source and its target: the excitation of a frequency response.
 *
 *   value_out = value_in + amplitude sin(frequency (t - start))
 *
 * With `held` the sine changes at the updates alone, as the command of a controller does; steps of the integrator end there.
 * The file that includes this says the shape of the value: INJECTION_NAME, INJECTION_DOC, INJECTION_SHAPE, INJECTION_PORT.
 */
#ifndef FCSL_SIM_MODELS_SINE_INJECTION_H
#define FCSL_SIM_MODELS_SINE_INJECTION_H

#include <stdbool.h>

#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double value INJECTION_SHAPE;
    } inputs;
    struct {
        double amplitude INJECTION_SHAPE;
        double frequency;
        double start;
        bool held;
    } parameters;
    struct {
        double sine;
    } state;
    struct {
        double value INJECTION_SHAPE;
    } outputs;
} injection_t;

static double sine_at(const injection_t *injection, double t)
{
    return cr_sin(injection->parameters.frequency * (t - injection->parameters.start));
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    const injection_t *injection = self;
    return injection->parameters.frequency >= 0.0 ? NULL : "parameters.frequency must not be negative";
}

static void update(void *self, const fcsl_model_context_t *context)
{
    injection_t *injection = self;
    injection->state.sine = sine_at(injection, (double)context->time_ns * 1e-9);
}

static void output(void *self, double t, const double *x)
{
    injection_t *injection = self;
    (void)x;
    const double sine = injection->parameters.held ? injection->state.sine : sine_at(injection, t);
    const double *value = (const double *)(const void *)&injection->inputs.value;
    const double *amplitude = (const double *)(const void *)&injection->parameters.amplitude;
    double *sum = (double *)(void *)&injection->outputs.value;
    for (size_t i = 0; i < sizeof injection->inputs.value / sizeof(double); i++) {
        sum[i] = value[i] + amplitude[i] * sine;
    }
}

static const fcsl_field_t fields[] = {
    INJECTION_PORT(injection_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.value, "", "from the source"),
    INJECTION_PORT(injection_t, FCSL_ROLE_PARAMETER, parameters.amplitude, "", "in the unit of the value"),
    FCSL_MODEL_SCALAR(injection_t, FCSL_ROLE_PARAMETER, parameters.frequency, "rad/s", ""),
    FCSL_MODEL_SCALAR(injection_t, FCSL_ROLE_PARAMETER, parameters.start, "s", "a time at which the sine is zero"),
    FCSL_MODEL_SCALAR(injection_t, FCSL_ROLE_PARAMETER, parameters.held, "", "the sine changes at the updates alone"),
    FCSL_MODEL_SCALAR(injection_t, FCSL_ROLE_STATE, state.sine, "", "at the last update"),
    INJECTION_PORT(injection_t, FCSL_ROLE_FEEDTHROUGH, outputs.value, "", "to the target"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = INJECTION_NAME,
    .doc = INJECTION_DOC,
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(injection_t),
    .align = _Alignof(injection_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};

#endif /* FCSL_SIM_MODELS_SINE_INJECTION_H */
