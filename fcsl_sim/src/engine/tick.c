/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of the first controller: its sensors, and what its actuators hold from then on.
 */
#include "tick.h"

#include "fcsl/fcsl_fp_mode.h"
#include "actuators.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "instants.h"
#include "plant/value_names.h"

int64_t fcsl_sim_sense(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_error_t *error)
{
    fcsl_message_t message;
    return fcsl_sim_sense_message(sim, bytes, capacity, &message, error) == 0 ? (int64_t)message.size : -1;
}

static int sense(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message, fcsl_error_t *error)
{
    if (sim->status != FCSL_SIM_RUNNING) {
        return fcsl_fail(error, "the simulation is over");
    }
    if (sim->sensed) {
        return fcsl_fail(error, "tick %llu was sensed and waits for its actuator message",
                         (unsigned long long)sim->tick);
    }
    if (sim->failed) {
        return fcsl_fail(error, "tick %llu has failed: the simulation cannot go on", (unsigned long long)sim->tick);
    }
    sim->failed = 1;
    for (int ticked = 0; !ticked;) { /* the next tick is in the queue, with finitely many events before it */
        if (fcsl_sim_next_instant(sim, &ticked, error)) {
            fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
            return -1;
        }
    }
    if (fcsl_sim_check_outputs(&sim->plant, error) || fcsl_sim_schedule_tick(sim, sim->tick + 1u)) {
        return -1;
    }
    sim->failed = 0;
    fcsl_sensors_sample(&sim->plant, sim->sensors, sim->sensor_count, sim->select, sim->machine->channel_count);
    sim->sensed = 1;
    const fcsl_message_status_t status = fcsl_message_encode_sensors(fcsl_run_channels(sim->run), sim->image, sim->tick,
                                                                     sim->select, bytes, capacity, message);
    if (status == FCSL_MESSAGE_SHORT) {
        return fcsl_fail(error, "no room for a sensor message in %zu bytes", capacity);
    }
    if (status != FCSL_MESSAGE_OK) {
        return fcsl_fail(error, "sensor message refused: %s", fcsl_message_status_text(status));
    }
    const char *wrong = sim->link ? fcsl_sim_link_sense(sim->link, message, bytes, capacity) : NULL;
    return wrong ? fcsl_fail(error, "tick %llu: %s", (unsigned long long)sim->tick, wrong) : 0;
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

/* Without a value, as of a division by zero, it does not hold. */
static int until_holds(const fcsl_sim_t *sim)
{
    fcsl_expression_value_t value;
    fcsl_expression_error_t error;
    return fcsl_expression_run(sim->until, &value, &error) == 0 && value.integer != 0;
}

int fcsl_sim_actuate(fcsl_sim_t *sim, const uint8_t *bytes, size_t size, fcsl_error_t *error)
{
    fcsl_message_t message = {0};
    const fcsl_message_status_t status =
        fcsl_message_check(fcsl_run_channels(sim->run), FCSL_ACTUATOR_MESSAGE, bytes, size, &message);
    if (sim->sensed && status != FCSL_MESSAGE_OK) {
        return fcsl_fail(error, "actuator message of tick %llu refused: %s", (unsigned long long)sim->tick,
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
    if (sim->until != NULL) {
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
        return fcsl_fail(error, "an actuator message for tick %llu, which was not sensed yet",
                         (unsigned long long)sim->tick);
    }
    if (message->tick != sim->tick) {
        return fcsl_fail(error, "actuator message of tick %llu where that of tick %llu is due",
                         (unsigned long long)message->tick, (unsigned long long)sim->tick);
    }
    fcsl_gate_wait(&sim->gate, (uint64_t)sim->plant.time_ns,
                   sim->image); /* a link may have delivered nothing for long */
    fcsl_message_t due;
    const int is_due = fcsl_delay_pass(&sim->delay, fcsl_run_channels(sim->run), sim->tick, message, &due);
    const char *wrong = is_due && sim->link ? fcsl_sim_link_command(sim->link, &due) : NULL;
    if (wrong) {
        return fcsl_fail(error, "tick %llu: %s", (unsigned long long)sim->tick, wrong);
    }
    if (is_due && !sim->link) {
        fcsl_sim_take_command(sim, &due);
    }
    complete_tick(sim);
    return 0;
}
