/* SPDX-License-Identifier: Apache-2.0
 *
 * An event function of time alone: 0: t - next, from which `reset` goes on; 1: -|t - next|, which touches zero; 2: as 0, but no number
 * from `next` on.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double first, period;
        int64_t kind;
    } parameters;
    struct {
        double next;
        int64_t count, last_ns;
    } state;
    struct {
        int64_t count, last_ns;
    } outputs;
} alarm_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    alarm_t *alarm = self;
    (void)context;
    alarm->state.next = alarm->parameters.first;
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    alarm_t *alarm = self;
    (void)t, (void)x;
    alarm->outputs.count = alarm->state.count;
    alarm->outputs.last_ns = alarm->state.last_ns;
}

static void event(const void *self, double t, const double *x, double *value)
{
    const alarm_t *alarm = self;
    const double since = t - alarm->state.next;
    (void)x;
    value[0] = alarm->parameters.kind == 1 ? -fabs(since) : alarm->parameters.kind == 2 && since >= 0.0 ? NAN : since;
}

static void reset(void *self, const fcsl_model_context_t *context, uint32_t number)
{
    alarm_t *alarm = self;
    (void)number;
    alarm->state.count++;
    alarm->state.last_ns = context->time_ns;
    alarm->state.next = alarm->parameters.first + (double)alarm->state.count * alarm->parameters.period;
}

#define FIELD(role_, path_, unit_) FCSL_MODEL_SCALAR(alarm_t, FCSL_ROLE_##role_, path_, unit_, "")

static const fcsl_field_t fields[] = {
    FIELD(PARAMETER, parameters.first, "s"), FIELD(PARAMETER, parameters.period, "s"),
    FIELD(PARAMETER, parameters.kind, ""),   FIELD(STATE, state.next, "s"),
    FIELD(OUTPUT, outputs.count, ""),        FIELD(OUTPUT, outputs.last_ns, "ns"),
};

static const fcsl_model_event_t events[] = {{"alarm", FCSL_EITHER, "it is time"}};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "alarm",
    .doc = "an alarm clock",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(alarm_t),
    .align = _Alignof(alarm_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .events = events,
    .event_count = 1,
    .init = init,
    .output = output,
    .event = event,
    .reset = reset,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
