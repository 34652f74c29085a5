/* SPDX-License-Identifier: Apache-2.0
 *
 * A rocket of two stages in empty space: v' = thrust / m, m' = -flow. A stage that has burnt out is dropped, and the next one burns.
 */
#include "fcsl/fcsl_model.h"

enum { STAGES = 2 };

typedef struct {
    struct {
        double dry[STAGES], fuel[STAGES], thrust[STAGES], flow[STAGES];
    } parameters;
    struct {
        double v, mass;
        int64_t stage, burnout_ns[STAGES];
    } state;
    struct {
        double v, mass;
        int64_t stage, burnout_ns[STAGES];
    } outputs;
} stages_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    stages_t *rocket = self;
    (void)context;
    for (int i = 0; i < STAGES; i++) {
        rocket->state.mass += rocket->parameters.dry[i] + rocket->parameters.fuel[i];
    }
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const stages_t *rocket = self;
    const int64_t stage = rocket->state.stage;
    (void)t;
    dx[0] = stage < STAGES ? rocket->parameters.thrust[stage] / x[1] : 0.0;
    dx[1] = stage < STAGES ? -rocket->parameters.flow[stage] : 0.0;
}

static void output(void *self, double t, const double *x)
{
    stages_t *rocket = self;
    (void)t;
    rocket->outputs.v = x[0];
    rocket->outputs.mass = x[1];
    rocket->outputs.stage = rocket->state.stage;
    for (int i = 0; i < STAGES; i++) {
        rocket->outputs.burnout_ns[i] = rocket->state.burnout_ns[i];
    }
}

/* The fuel of the stage that burns. */
static void event(const void *self, double t, const double *x, double *value)
{
    const stages_t *rocket = self;
    double empty = 0.0;
    (void)t;
    for (int64_t i = rocket->state.stage; i < STAGES; i++) {
        empty += rocket->parameters.dry[i] + (i > rocket->state.stage ? rocket->parameters.fuel[i] : 0.0);
    }
    value[0] = rocket->state.stage < STAGES ? x[1] - empty : 1.0;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    stages_t *rocket = self;
    (void)number;
    rocket->state.burnout_ns[rocket->state.stage] = context->time_ns;
    rocket->state.mass -= rocket->parameters.dry[rocket->state.stage];
    rocket->state.stage++;
}

#define SCALAR(role_, path_, unit_) FCSL_MODEL_SCALAR(stages_t, FCSL_ROLE_##role_, path_, unit_, "")
#define VECTOR(role_, path_, unit_) FCSL_MODEL_VECTOR(stages_t, FCSL_ROLE_##role_, path_, unit_, "")

static const fcsl_field_t fields[] = {
    VECTOR(PARAMETER, parameters.dry, "kg"),
    VECTOR(PARAMETER, parameters.fuel, "kg"),
    VECTOR(PARAMETER, parameters.thrust, "N"),
    VECTOR(PARAMETER, parameters.flow, "kg/s"),
    SCALAR(STATE, state.v, "m/s"),
    SCALAR(STATE, state.mass, "kg"),
    SCALAR(OUTPUT, outputs.v, "m/s"),
    SCALAR(OUTPUT, outputs.mass, "kg"),
    SCALAR(OUTPUT, outputs.stage, ""),
    VECTOR(OUTPUT, outputs.burnout_ns, "ns"),
};

static const fcsl_model_event_t events[] = {{"burnout", FCSL_FALLING, "of a stage"}};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "stages",
    .doc = "a rocket of two stages",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(stages_t),
    .align = _Alignof(stages_t),
    .continuous_offset = offsetof(stages_t, state.v),
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
