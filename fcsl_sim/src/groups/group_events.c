/* SPDX-License-Identifier: Apache-2.0
 *
 * Events of a group: when they happen, to the nanosecond, and what they do.
 */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "group.h"

enum { ROUNDS_MAX = 64 }; /* a step of 2^63 ns is halved 63 times */

/* The instance and the number of an event of the group. */
static const fcsl_instance_state_t *instance_of(const fcsl_group_t *group, uint32_t event, uint32_t *number)
{
    uint32_t i = 0;
    while (event - group->plant->instances[group->eventful[i]].first_event >=
           group->plant->instances[group->eventful[i]].model->event_count) {
        i++; /* one of them has it */
    }
    const fcsl_instance_state_t *instance = &group->plant->instances[group->eventful[i]];
    *number = event - instance->first_event;
    return instance;
}

int fcsl_group_any_crosses(const fcsl_group_t *group, const double *before, const double *after)
{
    for (uint32_t i = 0; i < group->event_count; i++) {
        if (fcsl_group_crosses(group, i, before[i], after[i])) {
            return 1;
        }
    }
    return 0;
}

void fcsl_group_pass(fcsl_group_t *group, const double *now)
{
    for (uint32_t i = 0; i < group->event_count; i++) {
        group->g[i] = now[i] == 0.0 && group->g[i] != 0.0 ? group->g[i] : now[i];
    }
}

int fcsl_group_check_events(const fcsl_group_t *group, double t, const double *value, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < group->event_count; i++) {
        if (isnan(value[i])) {
            uint32_t number = 0;
            const fcsl_instance_state_t *instance = instance_of(group, i, &number);
            return fcsl_fail(error, "the function of event `%s` of `%s` is no number at %.9f s",
                             instance->model->events[number].name, instance->name, t);
        }
    }
    return 0;
}

/* ---- locating ----------------------------------------------------------------------------------------------------------- */

typedef struct {
    fcsl_group_t *group;
    fcsl_probe_t probe;
    int64_t from_ns;
    uint32_t event;
    int64_t before_ns; /* the event has not happened yet */
    int64_t after_ns;  /* it has */
    double before;
    double after;
} search_t;

/* Looks at one offset within the bracket, which becomes smaller. */
static void try_offset(search_t *search, int64_t offset_ns)
{
    fcsl_group_t *group = search->group;
    search->probe(group, offset_ns, group->probe);
    /* A NaN here counts as not yet; where the search ends it is found again. */
    (void)fcsl_group_events(group, (double)(search->from_ns + offset_ns) / FCSL_NS_PER_S, group->probe, group->g_probe,
                            NULL);
    const double value = group->g_probe[search->event];
    if (fcsl_group_crosses(group, search->event, group->g[search->event], value)) {
        search->after_ns = offset_ns;
        search->after = value;
    } else {
        search->before_ns = offset_ns;
        search->before = value;
    }
}

static int64_t within(const search_t *search, int64_t offset_ns)
{
    const int64_t low = search->before_ns + 1;
    const int64_t high = search->after_ns - 1;
    return offset_ns < low ? low : offset_ns > high ? high : offset_ns;
}

/* Where the line between the ends of the bracket is zero. */
static int64_t guess(const search_t *search)
{
    const double part = search->before / (search->before - search->after);
    const double length = (double)(search->after_ns - search->before_ns);
    return within(search, search->before_ns + (isfinite(part) ? (int64_t)(part * length) : 0));
}

/* The first nanosecond at which an event has happened. A round looks at the zero of a line, next to it at the other side, and in
 * the middle, so that the bracket halves at least. */
static int64_t locate(search_t *search)
{
    int64_t beside_ns = 1;
    for (int round = 0; round < ROUNDS_MAX && search->after_ns - search->before_ns > 1; round++) {
        const int64_t length_ns = search->after_ns - search->before_ns;
        const int64_t at_ns = guess(search);
        try_offset(search, at_ns);
        if (search->after_ns - search->before_ns > 1) {
            try_offset(search, within(search, search->after_ns == at_ns ? at_ns - beside_ns : at_ns + beside_ns));
        }
        if (search->after_ns - search->before_ns > 1 && search->after_ns - search->before_ns > length_ns / 2) {
            try_offset(search, search->before_ns + (search->after_ns - search->before_ns) / 2);
        }
        beside_ns = beside_ns < length_ns / 16 ? beside_ns * 16 : beside_ns;
    }
    return search->after_ns;
}

int64_t fcsl_group_locate(fcsl_group_t *group, int64_t from_ns, int64_t length_ns, fcsl_probe_t probe)
{
    int64_t first_ns = length_ns;
    for (uint32_t i = 0; i < group->event_count; i++) {
        if (!fcsl_group_crosses(group, i, group->g[i], group->g1[i])) {
            continue;
        }
        search_t search = {group, probe, from_ns, i, 0, length_ns, group->g[i], group->g1[i]};
        if (first_ns < length_ns) { /* only what happens before the first one so far is of interest */
            search.after_ns = first_ns + 1;
            try_offset(&search, first_ns);
            if (search.after_ns > first_ns) {
                continue;
            }
        }
        first_ns = locate(&search);
    }
    return first_ns;
}

/* ---- what happens then -------------------------------------------------------------------------------------------------- */

/* Inputs within the group, and outputs, at the present. */
static void evaluate(fcsl_group_t *group)
{
    fcsl_plant_t *plant = group->plant;
    const double t = fcsl_group_time_s(group);
    for (uint32_t i = 0; i < group->output_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->outputs[i]];
        fcsl_plant_copy(plant, instance->first_copy + instance->outer_count, instance->inner_count);
        fcsl_plant_enter(plant, group->outputs[i], FCSL_IN_OUTPUT);
        instance->model->output(instance->data, t,
                                instance->model->continuous_count > 0 ? group->x + instance->first_state : NULL);
    }
    for (uint32_t i = 0; i < group->eventful_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->eventful[i]];
        fcsl_plant_copy(plant, instance->first_copy + instance->outer_count, instance->inner_count);
    }
}

static int check_chatter(fcsl_group_t *group, uint32_t event, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    const int soon = state->events_in_a_row > 0 && state->time_ns - state->last_event_ns <= FCSL_CHATTER_NS;
    state->events_in_a_row = soon ? state->events_in_a_row + 1u : 1u;
    state->last_event_ns = state->time_ns;
    if (state->events_in_a_row < FCSL_CHATTER_EVENTS) {
        return 0;
    }
    uint32_t number = 0;
    const fcsl_instance_state_t *instance = instance_of(group, event, &number);
    return fcsl_fail(error,
                     "chattering at %.9f s: event `%s` of `%s` is the last of %u in a row, each at most %u ns "
                     "after the one before; let `reset` change a state that ends this, such as a ball at rest",
                     (double)state->time_ns / FCSL_NS_PER_S, instance->model->events[number].name, instance->name,
                     FCSL_CHATTER_EVENTS, FCSL_CHATTER_NS);
}

static int reset(fcsl_group_t *group, uint32_t event, fcsl_error_t *error)
{
    uint32_t number = 0;
    const fcsl_instance_state_t *instance = instance_of(group, event, &number);
    const uint32_t index = (uint32_t)(instance - group->plant->instances);
    fcsl_group_scatter(group, group->x);
    evaluate(group);
    const fcsl_model_context_t context = fcsl_plant_context(group->plant, index, group->state.time_ns);
    fcsl_plant_enter(group->plant, index, FCSL_IN_RESET);
    instance->model->reset(instance->data, &context, number);
    (void)fcsl_group_gather(group, group->x);
    return fcsl_group_check_finite(group, group->x, group->state.time_ns, error);
}

/* Handles the events whose functions came from group->g to `now`, in their order; returns 0, or -1. */
static int fire_once(fcsl_group_t *group, double *now, fcsl_error_t *error)
{
    uint32_t first = group->event_count;
    for (uint32_t i = group->event_count; i-- > 0;) {
        group->fired[i] = (uint8_t)fcsl_group_crosses(group, i, group->g[i], now[i]);
        first = group->fired[i] ? i : first;
    }
    if (check_chatter(group, first, error)) {
        return -1;
    }
    for (uint32_t i = 0; i < group->event_count; i++) {
        if (group->fired[i] && reset(group, i, error)) {
            return -1;
        }
    }
    fcsl_group_pass(group, now);
    if (fcsl_group_events(group, fcsl_group_time_s(group), group->x, now, error)) {
        return -1;
    }
    for (uint32_t i = 0; i < group->event_count; i++) {
        if (group->fired[i]) { /* what its own reset does to its function is no event */
            group->g[i] = now[i];
        }
    }
    return 0;
}

/* A reset may cause other events, by a jump of their functions. */
int fcsl_group_fire(fcsl_group_t *group, double *now, fcsl_error_t *error)
{
    while (fcsl_group_any_crosses(group, group->g, now)) { /* chattering ends it at the latest */
        if (fire_once(group, now, error)) {
            return -1;
        }
    }
    fcsl_group_pass(group, now);
    fcsl_group_restart(group);
    return 0;
}
