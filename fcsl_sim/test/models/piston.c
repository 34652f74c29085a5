/* SPDX-License-Identifier: Apache-2.0
 *
 * A piston that saturates: x' = u within [0, travel], and it holds at an end while u pushes it there.
 */
#include "fcsl/fcsl_model.h"

enum { FREE, LOW, HIGH };
enum { REACHES_LOW, REACHES_HIGH, LEAVES, EVENTS };

typedef struct {
    struct {
        double u;
    } inputs;
    struct {
        double travel, start;
    } parameters;
    struct {
        double x;
        int64_t at, changed_ns;
    } state;
    struct {
        double x;
        int64_t at, changed_ns;
    } outputs;
} piston_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    piston_t *piston = self;
    (void)context;
    piston->state.x = piston->parameters.start;
    return NULL;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const piston_t *piston = self;
    (void)t, (void)x;
    dx[0] = piston->state.at == FREE ? piston->inputs.u : 0.0;
}

static void output(void *self, double t, const double *x)
{
    piston_t *piston = self;
    (void)t;
    piston->outputs.x = x[0];
    piston->outputs.at = piston->state.at;
    piston->outputs.changed_ns = piston->state.changed_ns;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const piston_t *piston = self;
    const int is_free = piston->state.at == FREE;
    (void)t;
    value[REACHES_LOW] = is_free ? x[0] : 1.0;
    value[REACHES_HIGH] = is_free ? piston->parameters.travel - x[0] : 1.0;
    value[LEAVES] = is_free ? 1.0 : piston->state.at == HIGH ? piston->inputs.u : -piston->inputs.u;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    piston_t *piston = self;
    piston->state.at = number == LEAVES ? FREE : number == REACHES_LOW ? LOW : HIGH;
    piston->state.x = piston->state.at == LOW    ? 0.0
                      : piston->state.at == HIGH ? piston->parameters.travel
                                                 : piston->state.x;
    piston->state.changed_ns = context->time_ns;
}

#define FIELD(role_, path_, unit_) FCSL_MODEL_SCALAR(piston_t, FCSL_ROLE_##role_, path_, unit_, "")

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.u, "m/s"),
    FIELD(PARAMETER, parameters.travel, "m"),
    FIELD(PARAMETER, parameters.start, "m"),
    FIELD(STATE, state.x, "m"),
    FIELD(STATE, state.at, ""),
    FIELD(OUTPUT, outputs.x, "m"),
    FIELD(OUTPUT, outputs.at, ""),
    FIELD(OUTPUT, outputs.changed_ns, "ns"),
};

static const fcsl_model_event_t events[EVENTS] = {
    {"low", FCSL_FALLING, "it reaches the low end"},
    {"high", FCSL_FALLING, "it reaches the high end"},
    {"leaves", FCSL_FALLING, "it is pulled off the end"},
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "piston",
    .doc = "a piston between two ends",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(piston_t),
    .align = _Alignof(piston_t),
    .continuous_offset = offsetof(piston_t, state.x),
    .continuous_count = 1,
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = EVENTS,
    .init = init,
    .derivative = derivative,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
