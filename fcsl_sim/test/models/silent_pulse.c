/* SPDX-License-Identifier: Apache-2.0
 *
 * x' = 1 / length_s within a pulse, so that x is 1 after it. It does not announce when the pulse begins and ends; pulse.c does.
 */
#include "fcsl/fcsl_model.h"

#ifndef NAME
#define NAME      "silent_pulse"
#define NEXT_TIME NULL
#endif

typedef struct {
    struct {
        double at_s, length_s;
    } parameters;
    struct {
        double x;
    } state;
    struct {
        double x;
    } outputs;
} pulse_t;

static double end_s(const pulse_t *pulse)
{
    return pulse->parameters.at_s + pulse->parameters.length_s;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const pulse_t *pulse = self;
    dx[0] = t >= pulse->parameters.at_s && t < end_s(pulse) ? 1.0 / pulse->parameters.length_s : 0.0;
    (void)x;
}

static void output(void *self, double t, const double *x)
{
    (void)t;
    ((pulse_t *)self)->outputs.x = x[0];
}

#define FIELD(role, path, unit) FCSL_MODEL_SCALAR(pulse_t, FCSL_ROLE_##role, path, unit, "")

static const fcsl_field_t fields[] = {
    FIELD(PARAMETER, parameters.at_s, "s"),
    FIELD(PARAMETER, parameters.length_s, "s"),
    FIELD(OUTPUT, outputs.x, ""),
};

#ifdef ANNOUNCES
static double next_time(const void *self, double t)
{
    const pulse_t *pulse = self;
    return t < pulse->parameters.at_s ? pulse->parameters.at_s : t < end_s(pulse) ? end_s(pulse) : (double)INFINITY;
}
#endif

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = NAME,
    .doc = "a pulse, integrated",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(pulse_t),
    .align = _Alignof(pulse_t),
    .continuous_offset = offsetof(pulse_t, state),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .derivative = derivative,
    .output = output,
    .next_time = NEXT_TIME,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
