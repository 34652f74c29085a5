/* SPDX-License-Identifier: Apache-2.0
 *
 * y = gain * u + x, x' = rate * u: an output with feed-through (`through`) and one without (`free`). With a macro it is a model as
 * it must not be.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double u;
        int64_t mode;
    } inputs;
    struct {
        double gain, rate, x;
    } parameters;
    struct {
        double x, calls;
    } state;
    struct {
        double through, free;
        struct {
            double twice, both[2];
        } nested;
    } outputs;
} chain_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    chain_t *chain = self;
    (void)context;
    chain->state.x = chain->parameters.x;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const chain_t *chain = self;
    (void)t, (void)chain;
#ifndef FORGETS_DX
    dx[0] = chain->parameters.rate * chain->inputs.u;
#endif
#ifdef WRITES_MORE
    dx[1] = 0.0;
#endif
#ifdef BLOWS_UP
    dx[0] = 1.0 / (0.05 - t) + x[0];
#endif
#ifdef STALE
    dx[0] += chain->state.x;
#endif
    (void)x;
}

static void output(void *self, double t, const double *x)
{
    chain_t *chain = self;
    (void)t;
    chain->outputs.through = chain->parameters.gain * chain->inputs.u + x[0];
#ifndef FORGETS_OUTPUT
    chain->outputs.free = x[0];
#endif
    chain->outputs.nested.twice = 2.0 * x[0];
    chain->outputs.nested.both[0] = x[0];
#ifndef FORGETS_ELEMENT
    chain->outputs.nested.both[1] = -x[0];
#endif
#ifdef IMPURE
    chain->state.calls += 1.0;
#endif
#ifdef SECRET
    chain->outputs.free += chain->inputs.u;
#endif
#ifdef SECRET_MODE
    chain->outputs.free += chain->inputs.mode != 0 ? 1.0 : 0.0;
#endif
}

#define FIELD(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(chain_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.u, "", ""),
    FIELD(INPUT, inputs.mode, "", ""),
    FIELD(PARAMETER, parameters.gain, "", ""),
    FIELD(PARAMETER, parameters.rate, "", ""),
    FIELD(PARAMETER, parameters.x, "", "at the start"),
    FIELD(STATE, state.x, "", ""),
    FIELD(STATE, state.calls, "", ""),
    FIELD(FEEDTHROUGH, outputs.through, "", ""),
    FIELD(OUTPUT, outputs.free, "", ""),
    FIELD(OUTPUT, outputs.nested.twice, "", ""),
    FCSL_MODEL_VECTOR(chain_t, FCSL_ROLE_OUTPUT, outputs.nested.both, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "chain",
    .doc = "a link of a chain",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(chain_t),
    .align = _Alignof(chain_t),
    .continuous_offset = offsetof(chain_t, state.x),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
