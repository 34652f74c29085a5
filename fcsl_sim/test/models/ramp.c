/* SPDX-License-Identifier: Apache-2.0
 *
 * x' = rate: shows at which time inputs are read and up to which time states are integrated.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double rate;
    } inputs;
    struct {
        double x;
    } state;
    struct {
        double x;
        double seen_rate;
        int64_t time_ns;
    } outputs;
} ramp_t;

static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)t;
    (void)x;
    dx[0] = ((const ramp_t *)self)->inputs.rate;
}

static void output(void *self, double t, const double *x)
{
    ramp_t *ramp = self;
    ramp->outputs.x = x[0];
    ramp->outputs.seen_rate = ramp->inputs.rate;
    ramp->outputs.time_ns = (int64_t)(t * 1e9 + 0.5);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_INPUT, inputs.rate, "", ""),
    FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_STATE, state.x, "m", "integrated"),
    FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_OUTPUT, outputs.x, "m", "position"),
    FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_FEEDTHROUGH, outputs.seen_rate, "", "rate at the update"),
    FCSL_MODEL_SCALAR(ramp_t, FCSL_ROLE_OUTPUT, outputs.time_ns, "ns", "of the update"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "ramp",
    .doc = "integrates its input",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(ramp_t),
    .align = _Alignof(ramp_t),
    .continuous_offset = offsetof(ramp_t, state.x),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
