/* SPDX-License-Identifier: Apache-2.0
 *
 * Instants. From one to the next: integration up to it, scheduled writes, outputs and updates in the order of dataflow, then the
 * controllers beside the first one.
 */
#include "instants.h"

#include "fcsl/fcsl_fp_mode.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "base/scalar_bits.h"

enum { EVENT_UPDATE, EVENT_COMPANION, EVENT_TICK };

#define PRIORITY_TICK      UINT32_MAX /* behind the updates, each with the index of its instance */
#define PRIORITY_COMPANION (UINT32_MAX - 1u)

static int64_t tick_ns(const fcsl_sim_t *sim, uint64_t tick)
{
    return fcsl_grid_time_ns(tick, sim->machine->tick_hz);
}

int fcsl_sim_schedule_tick(fcsl_sim_t *sim, uint64_t tick)
{
    const fcsl_queued_event_t event = {.time_ns = tick_ns(sim, tick), .kind = EVENT_TICK, .priority = PRIORITY_TICK};
    return fcsl_event_queue_push(&sim->queue, event);
}

static int schedule_update(fcsl_sim_t *sim, uint32_t index)
{
    const fcsl_queued_event_t event = {
        .time_ns = sim->plant.instances[index].next_update_ns, .kind = EVENT_UPDATE, .index = index, .priority = index};
    return fcsl_event_queue_push(&sim->queue, event);
}

static int schedule_companion(fcsl_sim_t *sim, uint32_t index)
{
    const fcsl_queued_event_t event = {.time_ns = sim->companions[index].next_tick_ns,
                                       .kind = EVENT_COMPANION,
                                       .index = index,
                                       .priority = PRIORITY_COMPANION};
    return fcsl_event_queue_push(&sim->queue, event);
}

/* ---- an instant -------------------------------------------------------------------------------------------------------- */

static int64_t next_write_ns(const fcsl_sim_t *sim)
{
    return sim->next_event < sim->plan.event_count
               ? (int64_t)sim->plan.events[sim->event_order[sim->next_event]].time_ns
               : INT64_MAX;
}

/* The next write to an instance of a group. */
static int64_t next_write_to_ns(const fcsl_sim_t *sim, fcsl_group_t *group)
{
    const uint32_t number = (uint32_t)(group - sim->groups);
    uint32_t i = group->next_write > sim->next_event ? group->next_write : sim->next_event;
    while (i < sim->plan.event_count && sim->events[sim->event_order[i]].group != number) {
        i++;
    }
    group->next_write = i;
    return i < sim->plan.event_count ? (int64_t)sim->plan.events[sim->event_order[i]].time_ns : INT64_MAX;
}

/* When inputs of a group may jump next, after the present: at a tick, at a scheduled write to it, or when an instance that feeds it is
 * updated. */
static int64_t barrier_ns(const fcsl_sim_t *sim, fcsl_group_t *group)
{
    int64_t barrier = tick_ns(sim, sim->tick);
    const int64_t write_ns = next_write_to_ns(sim, group);
    barrier = write_ns < barrier ? write_ns : barrier;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        const int64_t due_ns = sim->companions[i].next_tick_ns;
        barrier = group->companions[i] && due_ns < barrier ? due_ns : barrier;
    }
    for (uint32_t i = 0; i < group->timed_count; i++) {
        const int64_t update_ns = sim->plant.instances[group->timed[i]].next_update_ns;
        barrier = update_ns < barrier ? update_ns : barrier;
    }
    return barrier;
}

/* Whether somebody reads outputs of the group at this instant. A group that an instant does not concern makes no step for it, so that
 * what is beside it changes none of its bits. */
static int is_read(const fcsl_sim_t *sim, const fcsl_group_t *group, int64_t time_ns)
{
    for (uint32_t i = 0; i < group->sampling_count; i++) {
        if (sim->plant.instances[group->sampling[i]].next_update_ns == time_ns) {
            return 1;
        }
    }
    return 0;
}

static int advance(fcsl_sim_t *sim, int64_t time_ns, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->group_count; i++) {
        fcsl_group_t *group = &sim->groups[i];
        const int64_t barrier = barrier_ns(sim, group);
        if ((barrier == time_ns || is_read(sim, group, time_ns)) &&
            fcsl_group_advance(group, time_ns, barrier, error)) {
            return -1;
        }
    }
    sim->plant.time_ns = time_ns;
    return 0;
}

void fcsl_sim_disturb(fcsl_sim_t *sim, uint32_t instance)
{
    if (sim->plant.instances[instance].group != FCSL_PLAN_NO_GROUP) {
        sim->groups[sim->plant.instances[instance].group].state.disturbed = 1;
    }
}

static void make_writes(fcsl_sim_t *sim)
{
    while (next_write_ns(sim) == sim->plant.time_ns) {
        const fcsl_write_t *write = &sim->events[sim->event_order[sim->next_event++]];
        fcsl_write_bits(write->to, write->size, write->bits);
        fcsl_sim_disturb(sim, write->instance);
    }
}

/* The inputs of an instance; its group hears of a jump. */
static void take_inputs(fcsl_sim_t *sim, uint32_t index)
{
    const fcsl_instance_state_t *instance = &sim->plant.instances[index];
    const fcsl_copy_t *copies = &sim->plant.copies[instance->first_copy];
    for (uint32_t i = 0; i < instance->outer_count; i++) {
        if (fcsl_plant_copy_changed(&copies[i])) {
            fcsl_sim_disturb(sim, index);
        }
    }
    fcsl_plant_copy(&sim->plant, instance->first_copy + instance->outer_count, instance->inner_count);
}

/* Whether the states of an instance are those of the present. */
static int is_present(const fcsl_sim_t *sim, uint32_t index)
{
    const uint32_t group = sim->plant.instances[index].group;
    return group == FCSL_PLAN_NO_GROUP || sim->groups[group].state.time_ns == sim->plant.time_ns;
}

static void call_output(fcsl_sim_t *sim, uint32_t index)
{
    fcsl_instance_state_t *instance = &sim->plant.instances[index];
    const fcsl_model_t *model = instance->model;
    const double *x = (const double *)(const void *)(instance->data + model->continuous_offset);
    take_inputs(sim, index);
    fcsl_plant_enter(&sim->plant, index, FCSL_IN_OUTPUT);
    model->output(instance->data, (double)sim->plant.time_ns / FCSL_NS_PER_S, model->continuous_count > 0 ? x : NULL);
    if (model->sampled_offset == FCSL_NO_OFFSET) {
        instance->samples++;
    }
}

static int call_update(fcsl_sim_t *sim, uint32_t index)
{
    fcsl_instance_state_t *instance = &sim->plant.instances[index];
    const fcsl_model_t *model = instance->model;
    const fcsl_model_context_t context = fcsl_plant_context(&sim->plant, index, sim->plant.time_ns);
    take_inputs(sim, index);
    fcsl_plant_enter(&sim->plant, index, FCSL_IN_UPDATE);
    model->update(instance->data, &context);
    if (sim->link && index == sim->link_instance) {
        fcsl_sim_link_tick(sim->link, sim->plant.time_ns);
    }
    if (model->sampled_offset == FCSL_NO_OFFSET || instance->data[model->sampled_offset]) {
        instance->samples++;
    }
    fcsl_sim_disturb(sim, index);
    instance->due = 0;
    instance->next_update += instance->every;
    instance->next_update_ns = fcsl_grid_time_ns(instance->next_update, instance->hz);
    return schedule_update(sim, index);
}

int fcsl_sim_check_fp_mode(const char *caller, fcsl_error_t *error)
{
    if (fcsl_fp_mode() == FCSL_FP_DEFAULT) {
        return 0;
    }
    return fcsl_fail(error,
                     "%s left another floating-point mode (rounding, or small numbers become zero): its code, or a "
                     "library that it loaded, changed it, and bits depend on it",
                     caller);
}

/* Outputs and due updates, sources before what they feed. */
static int evaluate(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.call_count; i++) {
        const fcsl_call_t *call = &sim->plant.calls[i];
        const char *name = sim->plant.instances[call->instance].name;
        if (call->kind != FCSL_CALL_UPDATE) {
            if (is_present(sim, call->instance)) {
                call_output(sim, call->instance);
            }
        } else if (sim->plant.instances[call->instance].due && call_update(sim, call->instance)) {
            return fcsl_fail(error, "the event queue overflowed");
        }
        if (fcsl_sim_check_fp_mode(name, error)) {
            return -1;
        }
    }
    fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
    return 0;
}

static int tick_companions(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        fcsl_companion_t *companion = &sim->companions[i];
        if (companion->due) {
            companion->due = 0;
            if (fcsl_companion_tick(companion, &sim->plant, error) || schedule_companion(sim, i)) {
                return -1;
            }
        }
    }
    return 0;
}

int fcsl_sim_next_instant(fcsl_sim_t *sim, int *ticked, fcsl_error_t *error)
{
    fcsl_queued_event_t event;
    if (fcsl_event_queue_peek(&sim->queue, &event)) {
        return fcsl_fail(error, "the event queue ran empty");
    }
    const int64_t write_ns = next_write_ns(sim);
    if (advance(sim, write_ns < event.time_ns ? write_ns : event.time_ns, error) ||
        fcsl_sim_check_fp_mode("a model with continuous states", error)) {
        return -1;
    }
    make_writes(sim);
    if (write_ns < event.time_ns) {
        return 0;
    }
    while (fcsl_event_queue_peek(&sim->queue, &event) == 0 && event.time_ns == sim->plant.time_ns) {
        (void)fcsl_event_queue_pop(&sim->queue, &event);
        if (event.kind == EVENT_TICK) {
            *ticked = 1;
        } else if (event.kind == EVENT_COMPANION) {
            sim->companions[event.index].due = 1;
        } else {
            sim->plant.instances[event.index].due = 1;
        }
    }
    if (evaluate(sim, error)) {
        return -1;
    }
    return tick_companions(sim, error);
}

void fcsl_sim_refill_queue(fcsl_sim_t *sim)
{
    sim->queue.count = 0;
    (void)fcsl_sim_schedule_tick(sim, sim->tick); /* there is room for all */
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        (void)schedule_companion(sim, i);
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        if (sim->plant.instances[i].hz > 0) {
            (void)schedule_update(sim, i);
        }
    }
}
