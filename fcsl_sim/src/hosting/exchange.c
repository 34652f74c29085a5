/* SPDX-License-Identifier: Apache-2.0
 *
 * One tick with the controller: a machine hosted in this process, or another process (an external controller). Both get the same
 * bytes.
 */
#define _GNU_SOURCE
#include "exchange.h"

#include <string.h>

#include "fcsl/fcsl_error.h"
#include "engine/tick.h"
#include "external_controller.h"
#include "fcsl/fcsl_monotonic.h"
#include "output/publish.h"
#include "recording.h"
#include "service.h"

/* Outputs of models into fields of the machine, where they have another value. */
static int write_fields(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const uint8_t *data = fcsl_run_data(sim->run);
    for (uint32_t i = 0; i < sim->write_count; i++) {
        const fcsl_field_link_t *link = &sim->writes[i];
        const fcsl_field_t *field = &sim->machine->fields[link->field];
        if (memcmp(data + field->offset, link->data, link->size) != 0 &&
            fcsl_run_set(sim->run, link->field, 0, link->data, link->size, error)) {
            return -1;
        }
    }
    return 0;
}

/* Exchanges the sensor message for the actuator message, which overwrites it; 0, or -1. */
static int step_machine(fcsl_sim_t *sim, fcsl_message_t *message, fcsl_error_t *error)
{
    if (fcsl_run_sense_message(sim->run, message, error) || write_fields(sim, error)) {
        return -1;
    }
    for (uint32_t i = 0; sim->recording && i < sim->plant.instance_count; i++) {
        if (fcsl_sim_record_model_message(sim, &sim->plant.instances[i], &sim->model_messages[i], error)) {
            return -1;
        }
    }
    if (fcsl_run_step(sim->run, 1, error)) {
        return -1;
    }
    if (fcsl_run_actuate_message(sim->run, sim->message_bytes, sim->message_capacity, message) != 0) {
        return fcsl_fail(error, "an actuator channel holds what its type does not have: there is no message of it");
    }
    return 0;
}

static int step_external(fcsl_sim_t *sim, fcsl_message_t *message, fcsl_error_t *error)
{
    fcsl_hal_status_t status = fcsl_external_send(sim->external, message, (uint64_t)sim->plant.time_ns);
    if (status != FCSL_HAL_OK) {
        return fcsl_sim_external_failed(sim, status, "cannot send the sensor message", error);
    }
    status = fcsl_external_receive(sim->external, sim->tick, sim->external_timeout_ms, message);
    if (status != FCSL_HAL_OK) {
        return fcsl_sim_external_failed(sim, status, "no actuator message from the controller", error);
    }
    return 0;
}

/* The controller runs free, too: its newest message counts, and without one the actuators hold. */
static int exchange_newest(fcsl_sim_t *sim, const fcsl_message_t *sensors, fcsl_error_t *error)
{
    fcsl_message_t command = {0};
    const fcsl_hal_status_t status = fcsl_external_send(sim->external, sensors, (uint64_t)sim->plant.time_ns);
    if (status != FCSL_HAL_OK) {
        return fcsl_sim_external_failed(sim, status, "cannot send the sensor message", error);
    }
    if (fcsl_external_take(sim->external, sim->tick, &command) == FCSL_HAL_OK) {
        return fcsl_sim_actuate_message(sim, &command, error);
    }
    fcsl_sim_hold(sim);
    return 0;
}

/* Exchanges messages with the controller, and completes the tick. */
static int exchange(fcsl_sim_t *sim, fcsl_message_t *message, fcsl_error_t *error)
{
    if (sim->external && fcsl_external_runs_free(sim->external)) {
        return exchange_newest(sim, message, error);
    }
    if (sim->external ? step_external(sim, message, error) : step_machine(sim, message, error)) {
        return -1;
    }
    return fcsl_sim_actuate_message(sim, message, error);
}

/* ---- counters of the variable server ------------------------------------------------------------------------------------ */

static uint64_t begin_tick(const fcsl_sim_t *sim)
{
    return sim->service ? fcsl_monotonic_ns() : 0;
}

static void end_tick(fcsl_sim_t *sim, uint64_t begun_ns)
{
    if (!sim->service) {
        return;
    }
    fcsl_tick_stats_t *stats = &sim->service->stats;
    fcsl_tick_stats_put(&stats->ticks, fcsl_tick_stats_get(&stats->ticks) + 1u);
    fcsl_tick_stats_put(&stats->messages_refused, fcsl_run_messages_refused(sim->run));
    fcsl_tick_stats_put(&stats->hardware_failures, fcsl_run_hardware_failures(sim->run));
    fcsl_tick_stats_put(&stats->records_dropped, fcsl_run_record_dropped(sim->run));
    fcsl_histogram_add(&stats->tick_time, fcsl_monotonic_ns() - begun_ns);
}

/* ---- all ---------------------------------------------------------------------------------------------------------------- */

int fcsl_sim_tick_once(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const uint64_t begun_ns = begin_tick(sim);
    fcsl_message_t message;
    if (fcsl_sim_sense_message(sim, sim->message_bytes, sim->message_capacity, &message, error) ||
        exchange(sim, &message, error)) {
        return -1;
    }
    if (sim->recording && sim->actuators &&
        fcsl_sim_record_model_message(sim, &sim->actuators->as_instance, &sim->actuators->message, error)) {
        return -1;
    }
    fcsl_sim_publish(sim);
    end_tick(sim, begun_ns);
    return 0;
}
