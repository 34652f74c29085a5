/* SPDX-License-Identifier: Apache-2.0
 *
 * The run loop. It goes from instant to instant: integration up to it, scheduled writes, outputs and updates in the order of
 * dataflow, then the controller.
 */
#include <stdlib.h>
#include <string.h>

#include "actuators.h"
#include "base/clock.h"
#include "base/fail.h"
#include "base/scalar_bits.h"
#include "checkpoints/plant_state.h"
#include "fcsl/fcsl_fp_mode.h"
#include "fcsl/fcsl_scalar.h"
#include "plant/model_contract.h"
#include "plant/model_prototypes.h"
#include "plant/value_names.h"

enum { EVENT_UPDATE, EVENT_COMPANION, EVENT_TICK };

#define PRIORITY_TICK      UINT32_MAX /* behind the updates, each with the index of its instance */
#define PRIORITY_COMPANION (UINT32_MAX - 1u)

static int64_t tick_ns(const fcsl_sim_t *sim, uint64_t tick)
{
    return fcsl_grid_time_ns(tick, sim->machine->tick_hz);
}

static int schedule_tick(fcsl_sim_t *sim, uint64_t tick)
{
    const fcsl_event_t event = {.time_ns = tick_ns(sim, tick), .kind = EVENT_TICK, .priority = PRIORITY_TICK};
    return fcsl_event_queue_push(&sim->queue, event);
}

static int schedule_update(fcsl_sim_t *sim, uint32_t index)
{
    const fcsl_event_t event = {
        .time_ns = sim->plant.instances[index].next_update_ns, .kind = EVENT_UPDATE, .index = index, .priority = index};
    return fcsl_event_queue_push(&sim->queue, event);
}

static int schedule_companion(fcsl_sim_t *sim, uint32_t index)
{
    const fcsl_event_t event = {.time_ns = sim->companions[index].next_tick_ns,
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

/* Its group sees at its next step what has been written. */
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

/* After a model has run: a mode that it left would change the bits of all others. */
static int check_mode(const char *who, fcsl_error_t *error)
{
    if (fcsl_fp_mode() == FCSL_FP_DEFAULT) {
        return 0;
    }
    return fcsl_sim_fail(error,
                         "%s left another floating-point mode (rounding, or small numbers become zero): its code, or a "
                         "library that it loaded, changed it, and bits depend on it",
                         who);
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
            return fcsl_sim_fail(error, "the event queue overflowed");
        }
        if (check_mode(name, error)) {
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

/* Goes to the next instant and does all that is due but for the controller's tick; *ticked: whether that is due. Returns 0, or -1. */
static int do_instant(fcsl_sim_t *sim, int *ticked, fcsl_error_t *error)
{
    fcsl_event_t event;
    if (fcsl_event_queue_peek(&sim->queue, &event)) {
        return fcsl_sim_fail(error, "the event queue ran empty");
    }
    const int64_t write_ns = next_write_ns(sim);
    if (advance(sim, write_ns < event.time_ns ? write_ns : event.time_ns, error) ||
        check_mode("a model with continuous states", error)) {
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

/* ---- opening ----------------------------------------------------------------------------------------------------------- */

static int init_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        const fcsl_model_context_t context = fcsl_plant_context(&sim->plant, i, 0);
        fcsl_plant_enter(&sim->plant, i, FCSL_IN_INIT);
        const char *wrong = instance->model->init ? instance->model->init(instance->data, &context) : NULL;
        if (check_mode(instance->name, error)) {
            return -1;
        }
        if (wrong) {
            return fcsl_sim_fail(error, "instance `%s`: %s", instance->name, fcsl_sim_init_reason(wrong));
        }
        if (fcsl_sim_check_contract(&sim->plant, i, error) || fcsl_sim_check_prototypes(&sim->plant, i, error)) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < sim->group_count; i++) {
        if (fcsl_group_check(&sim->groups[i], error) || fcsl_group_start(&sim->groups[i], error)) {
            return -1;
        }
    }
    fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
    return 0;
}

static int start_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_fp_mode_t callers = fcsl_fp_enter(); /* that of the libraries of models, now that they are loaded */
    const int failed = init_models(sim, error);
    fcsl_fp_leave(callers);
    return failed;
}

void fcsl_sim_refill_queue(fcsl_sim_t *sim)
{
    sim->queue.count = 0;
    (void)schedule_tick(sim, sim->tick); /* there is room for all */
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        (void)schedule_companion(sim, i);
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        if (sim->plant.instances[i].hz > 0) {
            (void)schedule_update(sim, i);
        }
    }
}

static int fill_queue(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (fcsl_event_queue_init(&sim->queue, sim->plant.instance_count + sim->companion_count + 1u)) {
        return fcsl_sim_fail(error, "no memory for the event queue");
    }
    fcsl_sim_refill_queue(sim);
    size_t vectors = 1;
    for (uint32_t i = 0; i < sim->group_count; i++) {
        const size_t saved = fcsl_group_saved(&sim->groups[i]);
        vectors = saved > vectors ? saved : vectors;
    }
    sim->group_scratch = calloc(vectors, sizeof *sim->group_scratch);
    sim->before = malloc(fcsl_plant_state_bytes(sim) + 1u);
    return sim->group_scratch && sim->before ? 0 : fcsl_sim_fail(error, "no memory for checkpoints");
}

static int attach(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        if (fcsl_companion_start(&sim->companions[i], error)) {
            return -1;
        }
    }
    return fcsl_run_attach(sim->run, error);
}

fcsl_sim_t *fcsl_sim_open(const char *plan, size_t size, fcsl_error_t *error)
{
    fcsl_sim_t *sim = calloc(1, sizeof *sim);
    if (!sim) {
        (void)fcsl_sim_fail(error, "no memory for a simulation");
        return NULL;
    }
    fcsl_sim_is_open(&sim->plant, 1);
    if (fcsl_plan_parse(&sim->plan, plan, size, error) || fcsl_assembly_build(sim, error) || start_models(sim, error) ||
        fill_queue(sim, error) || attach(sim, error)) {
        (void)fcsl_sim_close(sim, NULL);
        return NULL;
    }
    return sim;
}

/* ---- one tick ------------------------------------------------------------------------------------------------------------ */

int64_t fcsl_sim_sense(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_error_t *error)
{
    fcsl_message_t message;
    return fcsl_sim_sense_message(sim, bytes, capacity, &message, error) == 0 ? (int64_t)message.size : -1;
}

static int sense(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message, fcsl_error_t *error)
{
    if (sim->status != FCSL_SIM_RUNNING) {
        return fcsl_sim_fail(error, "the simulation is over");
    }
    if (sim->sensed) {
        return fcsl_sim_fail(error, "tick %llu was sensed and waits for its actuator message",
                             (unsigned long long)sim->tick);
    }
    if (sim->failed) {
        return fcsl_sim_fail(error, "tick %llu has failed: the simulation cannot go on", (unsigned long long)sim->tick);
    }
    sim->failed = 1;
    for (int ticked = 0; !ticked;) { /* the next tick is in the queue, with finitely many events before it */
        if (do_instant(sim, &ticked, error)) {
            fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
            return -1;
        }
    }
    if (fcsl_sim_check_outputs(&sim->plant, error) || schedule_tick(sim, sim->tick + 1u)) {
        return -1;
    }
    sim->failed = 0;
    fcsl_sensors_sample(&sim->plant, sim->sensors, sim->sensor_count, sim->select, sim->machine->channel_count);
    sim->sensed = 1;
    const fcsl_message_status_t status = fcsl_message_encode_sensors(fcsl_run_channels(sim->run), sim->image, sim->tick,
                                                                     sim->select, bytes, capacity, message);
    if (status == FCSL_MESSAGE_SHORT) {
        return fcsl_sim_fail(error, "no room for a sensor message in %zu bytes", capacity);
    }
    if (status != FCSL_MESSAGE_OK) {
        return fcsl_sim_fail(error, "sensor message refused: %s", fcsl_message_status_text(status));
    }
    const char *wrong = sim->link ? fcsl_sim_link_sense(sim->link, message, bytes, capacity) : NULL;
    return wrong ? fcsl_sim_fail(error, "tick %llu: %s", (unsigned long long)sim->tick, wrong) : 0;
}

int fcsl_sim_sense_message(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message,
                           fcsl_error_t *error)
{
    const fcsl_fp_mode_t callers = fcsl_fp_enter();
    const int failed = sense(sim, bytes, capacity, message, error);
    fcsl_fp_leave(callers);
    return failed;
}

void fcsl_sim_take_command(void *context, const fcsl_message_t *command)
{
    fcsl_sim_t *sim = context;
    /* Behind a line it is as old as its tick: one from before an outage does not open the gate again. */
    const int64_t made_ns = fcsl_grid_time_ns(command->tick, sim->machine->tick_hz);
    fcsl_gate_command(&sim->gate, command, (uint64_t)made_ns, sim->image);
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->plant.time_ns, sim->image);
}

static int until_holds(const fcsl_sim_t *sim)
{
    uint8_t bytes[8] = {0};
    fcsl_scalars_export(bytes, sim->until_field, sim->until_type, 1);
    const double value = fcsl_as_double(fcsl_get_u64(bytes), sim->until_type);
    const double limit = fcsl_as_double(sim->plan.until_value.bits, sim->until_type);
    switch (sim->plan.until) {
    case FCSL_UNTIL_EQUALS:
        return value == limit;
    case FCSL_UNTIL_ABOVE:
        return value > limit;
    case FCSL_UNTIL_BELOW:
        return value < limit;
    default:
        return 0;
    }
}

int fcsl_sim_actuate(fcsl_sim_t *sim, const uint8_t *bytes, size_t size, fcsl_error_t *error)
{
    fcsl_message_t message = {0};
    const fcsl_message_status_t status =
        fcsl_message_check(fcsl_run_channels(sim->run), FCSL_ACTUATOR_MESSAGE, bytes, size, &message);
    if (sim->sensed && status != FCSL_MESSAGE_OK) {
        return fcsl_sim_fail(error, "actuator message of tick %llu refused: %s", (unsigned long long)sim->tick,
                             fcsl_message_status_text(status));
    }
    return fcsl_sim_actuate_message(sim, &message, error);
}

/* The tick is over: the actuators hold from its time on. */
static void complete_tick(fcsl_sim_t *sim)
{
    fcsl_actuators_update(sim);
    sim->sensed = 0;
    sim->tick++;
    if (sim->plan.until != FCSL_UNTIL_NONE) {
        sim->until_held = until_holds(sim) ? sim->until_held + 1 : 0;
        if (sim->until_held >= sim->plan.until_ticks) {
            sim->status = FCSL_SIM_UNTIL;
        }
    }
    if (sim->status == FCSL_SIM_RUNNING && sim->tick >= sim->plan.ticks) {
        sim->status = FCSL_SIM_DURATION;
    }
}

void fcsl_sim_hold(fcsl_sim_t *sim)
{
    fcsl_message_t due;
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->plant.time_ns, sim->image);
    if (fcsl_delay_pass(&sim->delay, fcsl_run_channels(sim->run), sim->tick, NULL, &due)) {
        fcsl_sim_take_command(sim, &due);
    }
    complete_tick(sim);
}

int fcsl_sim_actuate_message(fcsl_sim_t *sim, const fcsl_message_t *message, fcsl_error_t *error)
{
    if (!sim->sensed) {
        return fcsl_sim_fail(error, "an actuator message for tick %llu, which was not sensed yet",
                             (unsigned long long)sim->tick);
    }
    if (message->tick != sim->tick) {
        return fcsl_sim_fail(error, "actuator message of tick %llu where that of tick %llu is due",
                             (unsigned long long)message->tick, (unsigned long long)sim->tick);
    }
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->plant.time_ns,
                   sim->image); /* a link may have delivered nothing for long */
    fcsl_message_t due;
    const int is_due = fcsl_delay_pass(&sim->delay, fcsl_run_channels(sim->run), sim->tick, message, &due);
    const char *wrong = is_due && sim->link ? fcsl_sim_link_command(sim->link, &due) : NULL;
    if (wrong) {
        return fcsl_sim_fail(error, "tick %llu: %s", (unsigned long long)sim->tick, wrong);
    }
    if (is_due && !sim->link) {
        fcsl_sim_take_command(sim, &due);
    }
    complete_tick(sim);
    return 0;
}

/* ---- further controllers ------------------------------------------------------------------------------------------------ */

uint32_t fcsl_sim_companion_count(const fcsl_sim_t *sim)
{
    return sim->companion_count;
}

const char *fcsl_sim_companion_name(const fcsl_sim_t *sim, uint32_t companion)
{
    return companion < sim->companion_count ? sim->companions[companion].name : NULL;
}

fcsl_run_t *fcsl_sim_companion(fcsl_sim_t *sim, uint32_t companion)
{
    return companion < sim->companion_count ? sim->companions[companion].run : NULL;
}

const char *fcsl_sim_companion_state(const fcsl_sim_t *sim, uint32_t companion, uint64_t *ticks)
{
    if (companion >= sim->companion_count) {
        return NULL;
    }
    const fcsl_companion_t *found = &sim->companions[companion];
    int32_t state = 0;
    memcpy(&state, (const uint8_t *)fcsl_run_data(found->run) + found->machine->state_offset, sizeof state);
    *ticks = found->tick;
    return found->machine->states[state].name; /* within the table: a run holds no other */
}

/* ---- writing ------------------------------------------------------------------------------------------------------------- */

fcsl_run_t *fcsl_sim_hosted(fcsl_sim_t *sim)
{
    return sim->run;
}

int fcsl_sim_write(fcsl_sim_t *sim, uint32_t instance, uint32_t offset, const void *bytes, uint32_t size,
                   fcsl_error_t *error)
{
    if (sim->sensed || instance >= sim->plant.instance_count || offset > sim->plant.instances[instance].model->size ||
        size > sim->plant.instances[instance].model->size - offset) {
        return fcsl_sim_fail(error, "a write that is not between two ticks, or not within an instance");
    }
    uint8_t *to = sim->plant.instances[instance].data + offset;
    if (memcmp(to, bytes, size) != 0) {
        memcpy(to, bytes, size);
        fcsl_sim_disturb(sim, instance);
    }
    return 0;
}

/* ---- reading ------------------------------------------------------------------------------------------------------------- */

const fcsl_machine_t *fcsl_sim_machine(const fcsl_sim_t *sim)
{
    return sim->machine;
}

int64_t fcsl_sim_time_ns(const fcsl_sim_t *sim)
{
    return sim->plant.time_ns;
}

uint64_t fcsl_sim_tick(const fcsl_sim_t *sim)
{
    return sim->tick;
}

uint64_t fcsl_sim_ticks(const fcsl_sim_t *sim)
{
    return sim->plan.ticks;
}

fcsl_sim_status_t fcsl_sim_status(const fcsl_sim_t *sim)
{
    return sim->status;
}

size_t fcsl_sim_message_capacity(const fcsl_sim_t *sim)
{
    return sim->message_capacity;
}

uint32_t fcsl_sim_instance_count(const fcsl_sim_t *sim)
{
    return sim->plant.instance_count;
}

const char *fcsl_sim_instance_name(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].name : NULL;
}

const fcsl_model_t *fcsl_sim_instance_model(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].model : NULL;
}

const void *fcsl_sim_channel_data(const fcsl_sim_t *sim)
{
    return sim->image;
}

int fcsl_sim_sampled(const fcsl_sim_t *sim, uint32_t channel)
{
    return channel < sim->machine->channel_count && sim->select[channel];
}

const void *fcsl_sim_instance_data(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].data : NULL;
}
