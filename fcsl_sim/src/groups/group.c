/* SPDX-License-Identifier: Apache-2.0
 *
 * The states of a group and its steps of fixed size.
 */
#include "group.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "plant/value_names.h"

/* ---- states of models ------------------------------------------------------------------------------------------------ */

static double *states_of(const fcsl_instance_state_t *instance)
{
    return (double *)(void *)(instance->data +
                              instance->model->continuous_offset); /* its alignment was checked at load */
}

static const double *part_of(const fcsl_instance_state_t *instance, const double *x)
{
    return instance->model->continuous_count > 0 ? x + instance->first_state : NULL;
}

void fcsl_group_scatter(const fcsl_group_t *group, const double *x)
{
    for (uint32_t i = 0; i < group->derived_count; i++) {
        const fcsl_instance_state_t *instance = &group->plant->instances[group->derived[i]];
        memcpy(states_of(instance), x + instance->first_state, instance->model->continuous_count * sizeof *x);
    }
}

int fcsl_group_gather(const fcsl_group_t *group, double *x)
{
    int changed = 0;
    for (uint32_t i = 0; i < group->derived_count; i++) {
        const fcsl_instance_state_t *instance = &group->plant->instances[group->derived[i]];
        const size_t size = instance->model->continuous_count * sizeof *x;
        if (memcmp(x + instance->first_state, states_of(instance), size) != 0) {
            memcpy(x + instance->first_state, states_of(instance), size);
            changed = 1;
        }
    }
    return changed;
}

void fcsl_group_name_state(const fcsl_group_t *group, uint32_t state, char *text, size_t size)
{
    for (uint32_t i = 0; i < group->derived_count; i++) {
        const fcsl_instance_state_t *instance = &group->plant->instances[group->derived[i]];
        if (state - instance->first_state < instance->model->continuous_count) {
            fcsl_sim_name_value(instance,
                                instance->model->continuous_offset + (state - instance->first_state) * sizeof(double),
                                text, size);
        }
    }
}

int fcsl_group_check_finite(const fcsl_group_t *group, const double *x, int64_t time_ns, fcsl_error_t *error)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < group->n; i++) {
        sum += x[i] * 0.0;
    }
    if (sum == 0.0) {
        return 0;
    }
    for (uint32_t i = 0; i < group->n; i++) {
        if (!isfinite(x[i])) {
            char name[FCSL_VALUE_NAME_BYTES];
            fcsl_group_name_state(group, i, name, sizeof name);
            return fcsl_fail(error, "%s became %g at %.9f s", name, isnan(x[i]) ? (double)NAN : x[i],
                             (double)time_ns / FCSL_NS_PER_S);
        }
    }
    return 0;
}

/* ---- derivatives, outputs, events ------------------------------------------------------------------------------------ */

static void evaluate_stages(fcsl_group_t *group, double t, const double *x)
{
    fcsl_plant_t *plant = group->plant;
    for (uint32_t i = 0; i < group->stage_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->stages[i]];
        fcsl_plant_copy(plant, instance->first_copy + instance->outer_count, instance->inner_count);
        fcsl_plant_enter(plant, group->stages[i], FCSL_IN_OUTPUT);
        instance->model->output(instance->data, t, part_of(instance, x));
    }
}

static void slope(void *context, double t, const double *x, double *dx)
{
    fcsl_group_t *group = context;
    fcsl_plant_t *plant = group->plant;
    t = fcsl_group_before_jump(group, t);
    evaluate_stages(group, t, x);
    for (uint32_t i = 0; i < group->derived_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->derived[i]];
        fcsl_plant_copy(plant, instance->first_copy + instance->outer_count, instance->inner_count);
        fcsl_plant_enter(plant, group->derived[i], FCSL_IN_DERIVATIVE);
        instance->model->derivative(instance->data, t, x + instance->first_state, dx + instance->first_state);
    }
}

/* The slope of a group of one instance, with nothing to evaluate or copy before. */
static void slope_of_one(void *context, double t, const double *x, double *dx)
{
    const fcsl_group_t *group = context;
    fcsl_plant_enter(group->plant, group->derived[0], FCSL_IN_DERIVATIVE);
    group->derivative(group->derivative_of, fcsl_group_before_jump(group, t), x, dx);
}

static fcsl_slope_t choose_slope(fcsl_group_t *group)
{
    const fcsl_instance_state_t *first = &group->plant->instances[group->derived[0]];
    if (group->derived_count != 1u || group->stage_count > 0 || first->inner_count > 0) {
        return slope;
    }
    group->derivative = first->model->derivative;
    group->derivative_of = first->data;
    return slope_of_one;
}

int fcsl_group_events(fcsl_group_t *group, double t, const double *x, double *value, fcsl_error_t *error)
{
    fcsl_plant_t *plant = group->plant;
    t = fcsl_group_before_jump(group, t);
    evaluate_stages(group, t, x);
    for (uint32_t i = 0; i < group->eventful_count; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[group->eventful[i]];
        fcsl_plant_copy(plant, instance->first_copy + instance->outer_count, instance->inner_count);
        fcsl_plant_enter(plant, group->eventful[i], FCSL_IN_EVENT);
        instance->model->event(instance->data, t, part_of(instance, x), value + instance->first_event);
    }
    return fcsl_group_check_events(group, t, value, error);
}

/* ---- one advance ------------------------------------------------------------------------------------------------------ */

double fcsl_group_time_s(const fcsl_group_t *group)
{
    const fcsl_group_state_t *state = &group->state;
    const int on_grid = group->plan->hz > 0 && state->time_ns == state->begin_ns;
    const double t = on_grid ? (double)state->step / (double)group->plan->hz : (double)state->time_ns / FCSL_NS_PER_S;
    return t > state->since_s ? t : state->since_s;
}

/* To the next step of the grid. Its times are those of fcsl_grid_time_ns, without a division. */
static void next_of_grid(fcsl_group_t *group)
{
    fcsl_group_state_t *state = &group->state;
    const uint64_t hz = group->plan->hz;
    state->begin_ns = state->end_ns;
    state->end_ns += (int64_t)(FCSL_NS_PER_S / hz);
    state->carry += FCSL_NS_PER_S % hz;
    if (state->carry >= hz) {
        state->carry -= hz;
        state->end_ns++;
    }
}

void fcsl_group_restart(fcsl_group_t *group)
{
    fcsl_integrator_restart(&group->integrator);
    group->state.next_s = 0.0;
    group->state.from_ns = group->state.time_ns;
    group->state.to_ns = group->state.time_ns;
    group->state.event_ns = 0;
}

/* Copies the inputs from outside of the group; whether one has changed. */
static int take_inputs(fcsl_group_t *group)
{
    int changed = 0;
    for (uint32_t i = 0; i < group->outer_count; i++) {
        changed |= fcsl_plant_copy_changed(&group->plant->copies[group->outer[i]]);
    }
    return changed;
}

/* One step of the grid, or a part of it: to time_ns, to the next point of the grid, or to the first event. */
typedef struct {
    double t;
    double h;
    double end;
    int64_t length_ns;
    int regular;
} step_t;

static step_t next_step(const fcsl_group_t *group, int64_t time_ns)
{
    const fcsl_group_state_t *state = &group->state;
    const double hz = (double)group->plan->hz;
    const int reaches_end = time_ns >= state->end_ns;
    const double t = fcsl_group_time_s(group);
    const double end = reaches_end ? (double)(state->step + 1u) / hz : (double)time_ns / FCSL_NS_PER_S;
    if (state->time_ns == state->begin_ns && reaches_end) {
        return (step_t){t, 1.0 / hz, end, state->end_ns - state->begin_ns, 1};
    }
    return (step_t){t, end - t, end, (reaches_end ? state->end_ns : time_ns) - state->time_ns, 0};
}

static void probe_fixed(fcsl_group_t *group, int64_t offset_ns, double *x)
{
    fcsl_integrator_step(&group->integrator, fcsl_group_time_s(group), (double)offset_ns / FCSL_NS_PER_S, 0, group->x,
                         x);
}

static void move_to(fcsl_group_t *group, int64_t time_ns)
{
    double *before = group->x;
    group->x = group->x1;
    group->x1 = before;
    group->state.time_ns = time_ns;
    if (time_ns == group->state.end_ns && group->plan->hz > 0) {
        group->state.step++;
        next_of_grid(group);
    }
}

static int step_fixed(fcsl_group_t *group, int64_t time_ns, fcsl_error_t *error)
{
    const step_t step = next_step(group, group->jump_ns < time_ns ? group->jump_ns : time_ns);
    const int64_t from_ns = group->state.time_ns;
    int64_t length_ns = step.length_ns;
    fcsl_integrator_step(&group->integrator, step.t, step.h, step.regular, group->x, group->x1);
    if (fcsl_group_check_finite(group, group->x1, from_ns + length_ns, error)) {
        return -1;
    }
    if (group->event_count == 0) {
        fcsl_integrator_accept(&group->integrator, step.regular);
        move_to(group, from_ns + length_ns);
        return 0;
    }
    if (fcsl_group_events(group, step.end, group->x1, group->g1, error)) {
        return -1;
    }
    const int happens = fcsl_group_any_crosses(group, group->g, group->g1);
    if (happens) {
        length_ns = fcsl_group_locate(group, from_ns, step.length_ns, probe_fixed);
        if (length_ns < step.length_ns) {
            probe_fixed(group, length_ns, group->x1);
            if (fcsl_group_events(group, (double)(from_ns + length_ns) / FCSL_NS_PER_S, group->x1, group->g1, error)) {
                return -1;
            }
        }
    }
    fcsl_integrator_accept(&group->integrator, step.regular && length_ns == step.length_ns);
    move_to(group, from_ns + length_ns);
    if (happens) {
        return fcsl_group_fire(group, group->g1, error);
    }
    fcsl_group_pass(group, group->g1);
    return 0;
}

int fcsl_group_start(fcsl_group_t *group, fcsl_error_t *error)
{
    (void)take_inputs(group);
    (void)fcsl_group_gather(group, group->x);
    return group->event_count > 0 ? fcsl_group_events(group, 0.0, group->x, group->g, error) : 0;
}

int fcsl_group_resume(fcsl_group_t *group, fcsl_error_t *error)
{
    fcsl_group_restart(group);
    if (group->event_count > 0) {
        return fcsl_group_events(group, fcsl_group_time_s(group), group->x, group->g1, error) ||
                       fcsl_group_fire(group, group->g1, error)
                   ? -1
                   : 0;
    }
    return 0;
}

/* The states and inputs that the group goes on with. */
static int begin(fcsl_group_t *group, fcsl_error_t *error)
{
    fcsl_group_state_t *state = &group->state;
    const int is_open = state->to_ns > state->time_ns; /* within a step of RK45: the models have interpolated states */
    const int inputs = take_inputs(group);
    const int states = !is_open && fcsl_group_gather(group, group->x);
    if (!inputs && !states && !state->disturbed) {
        return 0;
    }
    if (is_open) {
        (void)fcsl_group_gather(group, group->x);
    }
    state->disturbed = 0;
    return fcsl_group_resume(group, error);
}

int fcsl_group_advance(fcsl_group_t *group, int64_t time_ns, int64_t barrier_ns, fcsl_error_t *error)
{
    if (time_ns == group->state.time_ns) {
        return 0;
    }
    if (begin(group, error)) {
        return -1;
    }
    if (group->plan->method == FCSL_RK45) {
        return fcsl_group_advance_adaptive(group, time_ns, barrier_ns, error);
    }
    while (group->state.time_ns < time_ns) { /* each step ends later than it began */
        if (fcsl_group_find_jump(group, error) || step_fixed(group, time_ns, error) ||
            (group->state.time_ns == group->jump_ns && fcsl_group_jump(group, error))) {
            return -1;
        }
    }
    fcsl_group_scatter(group, group->x);
    return 0;
}

/* ---- life --------------------------------------------------------------------------------------------------------------- */

int fcsl_group_open(fcsl_group_t *group, fcsl_plant_t *plant, fcsl_error_t *error)
{
    const size_t n = fcsl_vector_room(group->n);
    const size_t events = group->event_count;
    group->plant = plant;
    group->last_s = INFINITY;
    group->jump_ns = INT64_MAX;
    group->memory = calloc(4u * n + 3u * events + fcsl_integrator_memory(group->n) + 1u, sizeof(double));
    if (!group->memory) {
        return fcsl_fail(error, "no memory for the states");
    }
    double *at = group->memory;
    group->x = at;
    group->x1 = at + n;
    group->probe = at + 2u * n;
    group->atol = at + 3u * n;
    group->g = at + 4u * n + fcsl_integrator_memory(group->n);
    group->g1 = group->g + events;
    group->g_probe = group->g1 + events;
    fcsl_integrator_init(&group->integrator, group->plan->method, group->n, choose_slope(group), group, at + 4u * n);
    group->integrator.blocks = group->blocks;
    group->integrator.block_count = group->derived_count;
    for (uint32_t i = 0; i < group->n; i++) {
        group->atol[i] = group->plan->atol;
    }
    if (group->plan->hz > 0) {
        next_of_grid(group); /* the first cell: from 0 */
    }
    return 0;
}

void fcsl_group_free(fcsl_group_t *group)
{
    free(group->derived);
    free(group->blocks);
    free(group->eventful);
    free(group->stages);
    free(group->outputs);
    free(group->timed);
    free(group->announcing);
    free(group->outer);
    free(group->sampling);
    free(group->companions);
    free(group->crossing);
    free(group->fired);
    free(group->memory);
}

/* Velocity Verlet: whether derivative number `i` is as the method needs it, with velocities and with others (`moved`). */
static int check_second_order(const fcsl_group_t *group, uint32_t velocity, uint32_t position, const double *dx,
                              const double *moved, fcsl_error_t *error)
{
    char name[FCSL_VALUE_NAME_BYTES];
    fcsl_group_name_state(group, velocity, name, sizeof name);
    if (memcmp(&dx[position], &group->x[velocity], sizeof *dx) != 0) {
        return fcsl_fail(error, "velocity Verlet: the derivative of %s is not that of a position", name);
    }
    if (memcmp(&dx[velocity], &moved[velocity], sizeof *dx) != 0) {
        return fcsl_fail(error,
                         "velocity Verlet: the derivative of %s depends on a velocity; use rk4, or another "
                         "integrator that allows this",
                         name);
    }
    return 0;
}

int fcsl_group_check(fcsl_group_t *group, fcsl_error_t *error)
{
    if (group->plan->method != FCSL_VERLET) {
        return 0;
    }
    const fcsl_integrator_t *integrator = &group->integrator;
    double *dx = integrator->k[0];
    double *moved = integrator->k[1];
    (void)take_inputs(group);
    (void)fcsl_group_gather(group, group->x);
    slope(group, 0.0, group->x, dx);
    memcpy(group->probe, group->x, group->n * sizeof *group->x);
    for (uint32_t b = 0, q = 0; b < integrator->block_count; q += integrator->blocks[b++]) {
        for (uint32_t i = integrator->blocks[b] / 2u; i < integrator->blocks[b]; i++) {
            group->probe[q + i] += 1.0;
        }
    }
    slope(group, 0.0, group->probe, moved);
    for (uint32_t b = 0, q = 0; b < integrator->block_count; q += integrator->blocks[b++]) {
        const uint32_t half = integrator->blocks[b] / 2u;
        for (uint32_t i = q; i < q + half; i++) {
            if (check_second_order(group, half + i, i, dx, moved, error)) {
                return -1;
            }
        }
    }
    return 0;
}

/* ---- checkpoints ---------------------------------------------------------------------------------------------------------- */

size_t fcsl_group_saved(const fcsl_group_t *group)
{
    return (size_t)(2u + FCSL_SLOPES) * group->n + group->event_count;
}

void fcsl_group_save(const fcsl_group_t *group, fcsl_group_state_t *state, double *vectors)
{
    const size_t bytes = group->n * sizeof *vectors;
    *state = group->state;
    state->has_slope = group->integrator.has_slope;
    state->kept = group->integrator.kept;
    memcpy(vectors, group->x, bytes);
    memcpy(vectors + group->n, group->x1, bytes);
    for (uint32_t i = 0; i < FCSL_SLOPES; i++) {
        memcpy(vectors + (size_t)(2u + i) * group->n, group->integrator.k[i], bytes);
    }
    memcpy(vectors + (size_t)(2u + FCSL_SLOPES) * group->n, group->g, group->event_count * sizeof *vectors);
}

void fcsl_group_restore(fcsl_group_t *group, const fcsl_group_state_t *state, const double *vectors)
{
    const size_t bytes = group->n * sizeof *vectors;
    group->state = *state;
    group->integrator.has_slope = state->has_slope;
    group->integrator.kept = state->kept;
    memcpy(group->x, vectors, bytes);
    memcpy(group->x1, vectors + group->n, bytes);
    for (uint32_t i = 0; i < FCSL_SLOPES; i++) {
        memcpy(group->integrator.k[i], vectors + (size_t)(2u + i) * group->n, bytes);
    }
    memcpy(group->g, vectors + (size_t)(2u + FCSL_SLOPES) * group->n, group->event_count * sizeof *vectors);
}
