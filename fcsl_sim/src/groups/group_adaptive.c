/* SPDX-License-Identifier: Apache-2.0
 *
 * Steps of adaptive size (RK45). They end at whole nanoseconds, at the latest when an input may jump. Between the ends states are
 * interpolated, so that a sensor that samples makes no step shorter.
 */
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "group.h"
#include "plant/value_names.h"

enum { REJECTED_MAX = 200 }; /* each makes the step smaller by 10 % at least */

static double step_s(const fcsl_group_t *group)
{
    return (double)(group->state.to_ns - group->state.from_ns) / FCSL_NS_PER_S;
}

static void probe_adaptive(fcsl_group_t *group, int64_t offset_ns, double *x)
{
    const double part = (double)offset_ns / (double)(group->state.to_ns - group->state.from_ns);
    fcsl_rk45_interpolate(&group->integrator, step_s(group), part, group->x, x);
}

/* Whole nanoseconds of a step of so many seconds, that ends at the barrier or leaves room for another one. */
static int64_t length_ns(const fcsl_group_t *group, double seconds, int64_t barrier_ns)
{
    const int64_t room_ns = barrier_ns - group->state.time_ns;
    const double wanted_ns = floor(seconds * FCSL_NS_PER_S);
    if (wanted_ns >= (double)room_ns) {
        return room_ns;
    }
    if (2.0 * wanted_ns > (double)room_ns) { /* two equal steps, instead of a tiny last one */
        return room_ns - room_ns / 2;
    }
    return wanted_ns < 1.0 ? 1 : (int64_t)wanted_ns;
}

static int too_small(const fcsl_group_t *group, double h, double error, uint32_t worst, fcsl_error_t *why)
{
    char name[FCSL_VALUE_NAME_BYTES];
    const double t = (double)group->state.time_ns / FCSL_NS_PER_S;
    fcsl_group_name_state(group, worst, name, sizeof name);
    if (isnan(error)) {
        return fcsl_fail(why, "%s has no finite value behind %.9f s, even with a step of %g s", name, t, h);
    }
    return fcsl_fail(why,
                     "the step underflows at %.9f s: with %g s, the smallest allowed (min_step_s), the error of %s "
                     "is %g times its tolerance; allow larger errors (atol, rtol), or look for a jump in its "
                     "derivative, which should be an event",
                     t, h, name, error);
}

/* Makes the step from the present on; x1 is its end. */
static int make_step(fcsl_group_t *group, int64_t barrier_ns, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    const fcsl_plan_group_t *plan = group->plan;
    const double t = fcsl_group_time_s(group);
    barrier_ns = group->jump_ns < barrier_ns ? group->jump_ns : barrier_ns;
    if (state->next_s == 0.0) {
        state->next_s =
            fcsl_rk45_first_step(&group->integrator, t, group->x, group->atol, plan->rtol, plan->max_step_s);
    }
    int rejected = 0;
    for (double wanted_s = state->next_s; rejected < REJECTED_MAX; rejected++) {
        const int64_t ns = length_ns(group, wanted_s > plan->min_step_s ? wanted_s : plan->min_step_s, barrier_ns);
        const double h = (double)ns / FCSL_NS_PER_S;
        uint32_t worst = 0;
        const double size =
            fcsl_rk45_step(&group->integrator, t, h, group->x, group->x1, group->atol, plan->rtol, &worst);
        const double factor = fcsl_rk45_factor(size);
        if (size <= 1.0) {
            /* A step that a barrier made short says nothing against the size tried before. */
            const double proposed_s = h * (rejected > 0 && factor > 1.0 ? 1.0 : factor);
            const double next_s = h < wanted_s && proposed_s < wanted_s ? wanted_s : proposed_s;
            state->next_s = next_s < plan->max_step_s ? next_s : plan->max_step_s;
            state->from_ns = state->time_ns;
            state->to_ns = state->time_ns + ns;
            return 0;
        }
        if (h <= plan->min_step_s || ns == 1) {
            return too_small(group, h, size, worst, error);
        }
        wanted_s = h * (factor < 0.9 ? factor : 0.9);
    }
    return fcsl_fail(error, "no step at %.9f s", t); /* not reached: min_step_s comes first */
}

/* The events within the step: the first one ends it. */
static int find_event(fcsl_group_t *group, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    state->event_ns = 0;
    if (group->event_count == 0) {
        return 0;
    }
    if (fcsl_group_events(group, (double)state->to_ns / FCSL_NS_PER_S, group->x1, group->g1, error)) {
        return -1;
    }
    if (fcsl_group_any_crosses(group, group->g, group->g1)) {
        state->event_ns =
            state->from_ns + fcsl_group_locate(group, state->from_ns, state->to_ns - state->from_ns, probe_adaptive);
    }
    return 0;
}

/* The step under way ends where its event is. */
static int end_at_event(fcsl_group_t *group, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    if (state->event_ns < state->to_ns) {
        probe_adaptive(group, state->event_ns - state->from_ns, group->probe);
        memcpy(group->x, group->probe, group->n * sizeof *group->x);
    } else {
        memcpy(group->x, group->x1, group->n * sizeof *group->x);
    }
    state->time_ns = state->event_ns;
    return fcsl_group_events(group, fcsl_group_time_s(group), group->x, group->g1, error) ||
                   fcsl_group_fire(group, group->g1, error)
               ? -1
               : 0;
}

static void end_step(fcsl_group_t *group)
{
    double *before = group->x;
    group->x = group->x1;
    group->x1 = before;
    group->state.time_ns = group->state.to_ns;
    fcsl_integrator_accept(&group->integrator, 1);
    fcsl_group_pass(group, group->g1);
}

int fcsl_group_advance_adaptive(fcsl_group_t *group, int64_t time_ns, int64_t barrier_ns, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    for (;;) { /* each turn ends a step or the loop */
        if (fcsl_group_find_jump(group, error)) {
            return -1;
        }
        if (state->to_ns <= state->time_ns) {
            if (state->time_ns >= time_ns) {
                break;
            }
            if (make_step(group, barrier_ns, error) || fcsl_group_check_finite(group, group->x1, state->to_ns, error)) {
                return -1;
            }
            if (find_event(group, error)) {
                return -1;
            }
        }
        if (state->event_ns > 0 && state->event_ns <= time_ns) {
            if (end_at_event(group, error)) {
                return -1;
            }
        } else if (state->to_ns <= time_ns && state->event_ns == 0) {
            end_step(group);
        } else {
            state->time_ns = time_ns;
            probe_adaptive(group, time_ns - state->from_ns, group->probe);
            fcsl_group_scatter(group, group->probe);
            return 0;
        }
        if (state->time_ns == group->jump_ns && fcsl_group_jump(group, error)) {
            return -1;
        }
    }
    fcsl_group_scatter(group, group->x);
    return 0;
}
