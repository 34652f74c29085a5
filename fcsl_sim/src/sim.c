/* SPDX-License-Identifier: Apache-2.0
 *
 * The run loop. Between two controller ticks it only pops events: at one time first the integration that ends there, then
 * scheduled writes, then updates in the order of instances, then the controller.
 */
#include <stdlib.h>
#include <string.h>

#include "actuators.h"
#include "clock.h"
#include "fail.h"
#include "fcsl/fcsl_scalar.h"
#include "sim_internal.h"

enum { EVENT_INTEGRATE, EVENT_WRITE, EVENT_UPDATE, EVENT_TICK };

#define PRIORITY_INTEGRATE 0u
#define PRIORITY_WRITE     1u
#define PRIORITY_UPDATE    2u /* + index of the instance */
#define PRIORITY_TICK      UINT32_MAX

static int schedule(fcsl_sim_t *sim, uint32_t kind, uint32_t index, uint64_t step)
{
    static const uint32_t priority[] = {PRIORITY_INTEGRATE, PRIORITY_WRITE, PRIORITY_UPDATE, PRIORITY_TICK};
    fcsl_event_t event = {.kind = kind, .index = index, .step = step, .priority = priority[kind]};
    if (kind == EVENT_UPDATE) {
        event.priority += index;
    }
    event.time_ns = kind == EVENT_WRITE ? (int64_t)sim->plan.events[index].time_ns
                                        : fcsl_grid_time_ns(step, sim->plan.integrator_hz);
    return fcsl_event_queue_push(&sim->queue, event);
}

static fcsl_model_context_t context_of(const fcsl_sim_t *sim, fcsl_instance_state_t *instance)
{
    return (fcsl_model_context_t){sim->time_ns, &instance->noise, fcsl_noise_gaussian, fcsl_noise_uniform};
}

static void copy_inputs(const fcsl_sim_t *sim, const fcsl_instance_state_t *instance)
{
    const fcsl_copy_t *copy = sim->copies + instance->first_copy;
    for (uint32_t i = 0; i < instance->copy_count; i++) {
        memcpy(copy[i].to, copy[i].from, copy[i].size);
    }
}

/* ---- events ------------------------------------------------------------------------------------------------------------ */

/* Integrates from step - 1 to step. All inputs are copied before any state changes, so the order of instances is irrelevant. */
static void do_integrate(fcsl_sim_t *sim, uint64_t step)
{
    const double hz = (double)sim->plan.integrator_hz;
    const double t = (double)(step - 1) / hz;
    const double h = 1.0 / hz;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        if (sim->instances[i].model->continuous_count) {
            copy_inputs(sim, &sim->instances[i]);
        }
    }
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const fcsl_model_t *model = sim->instances[i].model;
        if (!model->continuous_count) {
            continue;
        }
        uint8_t *self = sim->instances[i].data;
        double *x = (double *)(void *)(self + model->continuous_offset); /* its alignment was checked at load */
        fcsl_integrate(sim->plan.method, model->derivative, self, t, h, x, model->continuous_count, sim->scratch);
    }
}

static void do_update(fcsl_sim_t *sim, uint32_t index)
{
    fcsl_instance_state_t *instance = &sim->instances[index];
    const fcsl_model_t *model = instance->model;
    const fcsl_model_context_t context = context_of(sim, instance);
    copy_inputs(sim, instance);
    model->update(instance->data, &context);
    if (sim->link && index == sim->link_instance) {
        fcsl_sim_link_tick(sim->link, sim->time_ns);
    }
    if (model->sampled_offset == FCSL_NO_OFFSET || instance->data[model->sampled_offset]) {
        instance->fresh = 1;
    }
}

/* Handles one event; *ticked becomes non-zero if it was the controller's. */
static int handle(fcsl_sim_t *sim, const fcsl_event_t *event, int *ticked)
{
    const fcsl_write_t *write = &sim->events[event->index];
    switch (event->kind) {
    case EVENT_INTEGRATE:
        do_integrate(sim, event->step);
        return schedule(sim, EVENT_INTEGRATE, 0, event->step + 1);
    case EVENT_WRITE:
        fcsl_write_bits(write->to, write->size, write->bits);
        return 0;
    case EVENT_UPDATE:
        do_update(sim, event->index);
        return schedule(sim, EVENT_UPDATE, event->index, event->step + sim->instances[event->index].divisor);
    default:
        *ticked = 1;
        return schedule(sim, EVENT_TICK, 0, event->step + sim->steps_per_tick);
    }
}

/* ---- opening ----------------------------------------------------------------------------------------------------------- */

static int init_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        const fcsl_model_context_t context = context_of(sim, instance);
        const char *wrong = instance->model->init ? instance->model->init(instance->data, &context) : NULL;
        if (wrong) {
            return fcsl_sim_fail(error, "instance `%s`: %s", instance->name, wrong);
        }
    }
    return 0;
}

static int fill_queue(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    if (fcsl_event_queue_init(&sim->queue, sim->instance_count + plan->event_count + 2u)) {
        return fcsl_sim_fail(error, "no memory for the event queue");
    }
    int failed = schedule(sim, EVENT_INTEGRATE, 0, 1) || schedule(sim, EVENT_TICK, 0, 0);
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        failed |= schedule(sim, EVENT_UPDATE, i, 0);
    }
    for (uint32_t i = 0; i < plan->event_count; i++) {
        failed |= schedule(sim, EVENT_WRITE, i, 0);
    }
    return failed ? fcsl_sim_fail(error, "the event queue is too small") : 0;
}

fcsl_sim_t *fcsl_sim_open(const char *plan, size_t size, fcsl_error_t *error)
{
    fcsl_sim_t *sim = calloc(1, sizeof *sim);
    if (!sim) {
        (void)fcsl_sim_fail(error, "no memory for a simulation");
        return NULL;
    }
    if (fcsl_plan_parse(&sim->plan, plan, size, error) || fcsl_assembly_build(sim, error) || init_models(sim, error) ||
        fill_queue(sim, error) || fcsl_run_attach(sim->run, error)) {
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

int fcsl_sim_sense_message(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message,
                           fcsl_error_t *error)
{
    if (sim->status != FCSL_SIM_RUNNING) {
        return fcsl_sim_fail(error, "the simulation is over");
    }
    if (sim->sensed) {
        return fcsl_sim_fail(error, "tick %llu was sensed and waits for its actuator message",
                             (unsigned long long)sim->tick);
    }
    for (int ticked = 0; !ticked;) { /* the next tick is in the queue, with finitely many events before it */
        fcsl_event_t event;
        if (fcsl_event_queue_pop(&sim->queue, &event)) {
            return fcsl_sim_fail(error, "the event queue ran empty");
        }
        sim->time_ns = event.time_ns;
        if (handle(sim, &event, &ticked)) {
            return fcsl_sim_fail(error, "the event queue overflowed");
        }
    }
    memset(sim->select, 0, sim->machine->channel_count);
    for (uint32_t i = 0; i < sim->sensor_count; i++) {
        const fcsl_sensor_t *sensor = &sim->sensors[i];
        if (!sim->instances[sensor->instance].fresh) {
            continue;
        }
        memcpy(sensor->to, sensor->from, sensor->size);
        sim->select[sensor->channel] = 1;
    }
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        sim->instances[i].fresh = 0;
    }
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

void fcsl_sim_take_command(void *context, const fcsl_message_t *command)
{
    fcsl_sim_t *sim = context;
    /* Behind a line it is as old as its tick: one from before an outage does not open the gate again. */
    const int64_t made_ns = fcsl_grid_time_ns(command->tick, sim->machine->tick_hz);
    fcsl_gate_command(&sim->gate, command, (uint64_t)made_ns, sim->image);
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->time_ns, sim->image);
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
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->time_ns, sim->image);
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
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->time_ns, sim->image); /* a link may have delivered nothing for long */
    const char *wrong = sim->link ? fcsl_sim_link_command(sim->link, message) : NULL;
    if (wrong) {
        return fcsl_sim_fail(error, "tick %llu: %s", (unsigned long long)sim->tick, wrong);
    }
    if (!sim->link) {
        fcsl_sim_take_command(sim, message);
    }
    complete_tick(sim);
    return 0;
}

/* ---- reading ------------------------------------------------------------------------------------------------------------- */

const fcsl_machine_t *fcsl_sim_machine(const fcsl_sim_t *sim)
{
    return sim->machine;
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
    return sim->instance_count;
}

const char *fcsl_sim_instance_name(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->instance_count ? sim->instances[instance].name : NULL;
}

const fcsl_model_t *fcsl_sim_instance_model(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->instance_count ? sim->instances[instance].model : NULL;
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
    return instance < sim->instance_count ? sim->instances[instance].data : NULL;
}
