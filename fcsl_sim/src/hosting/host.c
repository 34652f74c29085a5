/* SPDX-License-Identifier: Apache-2.0
 *
 * The controller: a machine hosted in this process, or another process (an external controller). Both get the same bytes.
 */
#include <stdlib.h>
#include <string.h>

#include "base/fail.h"
#include "engine/sim_internal.h"
#include "fcsl/fcsl_external.h"

/* The outputs of an instance into the bag, at the present time; 0, or -1. */
static int record_truth(fcsl_sim_t *sim, const fcsl_instance_state_t *instance, fcsl_error_t *error)
{
    const size_t bytes = fcsl_truth_write(sim, instance, sim->truth, instance->truth_size);
    return fcsl_run_record_write(sim->run, instance->truth_topic, (uint64_t)sim->plant.time_ns, sim->truth,
                                 (uint32_t)bytes, error);
}

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
static int ask_machine(fcsl_sim_t *sim, fcsl_message_t *message, fcsl_error_t *error)
{
    if (fcsl_run_sense_message(sim->run, message, error) || write_fields(sim, error)) {
        return -1;
    }
    for (uint32_t i = 0; sim->recording && i < sim->plant.instance_count; i++) {
        if (record_truth(sim, &sim->plant.instances[i], error)) {
            return -1;
        }
    }
    if (fcsl_run_step(sim->run, 1, error)) {
        return -1;
    }
    if (fcsl_run_actuate_message(sim->run, sim->message_bytes, sim->message_capacity, message) != 0) {
        return fcsl_sim_fail(error, "an actuator channel holds what its type does not have: there is no message of it");
    }
    return 0;
}

int fcsl_sim_external_failed(const fcsl_sim_t *sim, fcsl_hal_status_t status, const char *doing, fcsl_error_t *error)
{
    const unsigned long long tick = sim->tick;
    if (status == FCSL_HAL_NONE) {
        return fcsl_sim_fail(error, "interrupted at tick %llu", tick);
    }
    return fcsl_sim_fail(error, "tick %llu: %s: %s", tick, doing, fcsl_external_explain(sim->external));
}

static int ask_external(fcsl_sim_t *sim, fcsl_message_t *message, fcsl_error_t *error)
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
    if (sim->external ? ask_external(sim, message, error) : ask_machine(sim, message, error)) {
        return -1;
    }
    return fcsl_sim_actuate_message(sim, message, error);
}

int fcsl_sim_tick_once(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const uint64_t begun_ns = fcsl_sim_tick_begins(sim);
    fcsl_message_t message;
    if (fcsl_sim_sense_message(sim, sim->message_bytes, sim->message_capacity, &message, error) ||
        exchange(sim, &message, error)) {
        return -1;
    }
    if (sim->recording && sim->actuators && record_truth(sim, &sim->actuators->as_instance, error)) {
        return -1;
    }
    fcsl_sim_publish(sim);
    fcsl_sim_tick_ends(sim, begun_ns);
    return 0;
}

int64_t fcsl_sim_run(fcsl_sim_t *sim, uint64_t ticks, fcsl_error_t *error)
{
    int64_t done = 0;
    while ((uint64_t)done < ticks && sim->status == FCSL_SIM_RUNNING) {
        const int32_t state = fcsl_sim_state(sim);
        const int goes_on = fcsl_sim_attend(sim);
        if (sim->service_failed) {
            *error = sim->failure;
            return -1;
        }
        if (!goes_on) {
            break;
        }
        if (fcsl_sim_tick_once(sim, error)) {
            return -1;
        }
        done++;
        if (fcsl_sim_state(sim) != state) {
            break;
        }
    }
    return done;
}

const void *fcsl_sim_machine_data(const fcsl_sim_t *sim)
{
    return fcsl_run_data(sim->run);
}

int32_t fcsl_sim_state(const fcsl_sim_t *sim)
{
    int32_t state = 0;
    memcpy(&state, (const uint8_t *)fcsl_sim_machine_data(sim) + sim->machine->state_offset, sizeof state);
    return state;
}

/* ---- recording --------------------------------------------------------------------------------------------------- */

static int add_truth_topic(fcsl_sim_t *sim, fcsl_instance_state_t *instance, const char *name_space,
                           fcsl_error_t *error)
{
    char topic[512];
    const int bytes =
        snprintf(topic, sizeof topic, "%s%s/sim/%s", name_space[0] ? "/" : "", name_space, instance->name);
    if (bytes < 0 || (size_t)bytes >= sizeof topic) {
        return fcsl_sim_fail(error, "the name of a topic is too long: /%s/sim/%s", name_space, instance->name);
    }
    instance->truth_topic =
        fcsl_run_record_add_topic(sim->run, topic, instance->truth_type, instance->truth_schema, error);
    return instance->truth_topic < 0 ? -1 : 0;
}

/* A companion has a bag of its own beside that of the first controller: BAG_NAME. */
static int record_companion(const fcsl_companion_t *companion, const char *bag, const char *name_space,
                            fcsl_error_t *error)
{
    char path[4096];
    const int bytes = snprintf(path, sizeof path, "%s_%s", bag, companion->name);
    if (bytes < 0 || (size_t)bytes >= sizeof path) {
        return fcsl_sim_fail(error, "the name of a bag is too long: %s_%s", bag, companion->name);
    }
    const fcsl_record_options_t options = {.bag = path, .name_space = name_space, .lossless = 1};
    return fcsl_run_record(companion->run, &options, error);
}

int fcsl_sim_record(fcsl_sim_t *sim, const char *bag, const char *name_space, fcsl_error_t *error)
{
    if (sim->sensed || sim->external) {
        return fcsl_sim_fail(error, "recording must begin between two ticks, with the controller in this process");
    }
    const fcsl_record_options_t options = {.bag = bag, .name_space = name_space, .lossless = 1};
    if (fcsl_run_record(sim->run, &options, error)) {
        return -1;
    }
    int failed = 0;
    for (uint32_t i = 0; i < sim->plant.instance_count && !failed; i++) {
        failed = add_truth_topic(sim, &sim->plant.instances[i], name_space, error);
    }
    if (!failed && sim->actuators) {
        failed = add_truth_topic(sim, &sim->actuators->as_instance, name_space, error);
    }
    if (failed) {
        (void)fcsl_run_record_stop(sim->run, NULL);
        return -1;
    }
    sim->recording = 1;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        if (record_companion(&sim->companions[i], bag, name_space, error)) {
            (void)fcsl_sim_record_stop(sim, NULL);
            return -1;
        }
    }
    return 0;
}

int fcsl_sim_record_stop(fcsl_sim_t *sim, fcsl_error_t *error)
{
    int status = 0;
    sim->recording = 0;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        status = fcsl_run_record_stop(sim->companions[i].run, error) != 0 ? -1 : status;
    }
    return fcsl_run_record_stop(sim->run, error) != 0 ? -1 : status;
}

/* ---- external controller -------------------------------------------------------------------------------------------- */

int fcsl_sim_listen(fcsl_sim_t *sim, const char *peer, const char *name_space, uint32_t timeout_ms, fcsl_error_t *error)
{
    static const char WIRE[] = "wire:";
    const size_t prefix = sizeof WIRE - 1u;
    char text[sizeof error->text] = "";
    if (sim->external || sim->tick || sim->sensed || sim->recording) {
        return fcsl_sim_fail(error, "a controller must connect before the first tick, once, and records itself");
    }
    if (sim->reads_fields || sim->write_count > 0) {
        return fcsl_sim_fail(
            error, "fields of the machine are connected: only channels reach a controller in another process");
    }
    const int failed = strncmp(peer, WIRE, prefix) == 0
                           ? fcsl_external_open(peer + prefix, sim->machine, &sim->external, text, sizeof text)
                           : fcsl_external_open_bus(peer, name_space, sim->machine, &sim->external, text, sizeof text);
    if (failed) {
        sim->external = NULL;
        return fcsl_sim_fail(error, "%s", text);
    }
    sim->external_timeout_ms = timeout_ms;
    return 0;
}

int fcsl_sim_accept(fcsl_sim_t *sim, uint32_t wait_ms, fcsl_error_t *error)
{
    if (!sim->external || sim->tick) {
        return fcsl_sim_fail(error, "nothing listens for a controller, or it has connected already");
    }
    if (fcsl_external_runs_free(sim->external)) {
        return 0;
    }
    const fcsl_hal_status_t status = fcsl_external_accept(sim->external, wait_ms);
    if (status == FCSL_HAL_OK) {
        return 0;
    }
    if (status == FCSL_HAL_NONE) {
        return fcsl_sim_fail(error, "interrupted while waiting for a controller");
    }
    (void)fcsl_sim_fail(error, "no controller: %s", fcsl_external_explain(sim->external));
    return status == FCSL_HAL_TIMEOUT ? 1 : -1;
}

int fcsl_sim_read_log(fcsl_sim_t *sim, char text[FCSL_LOG_BYTES])
{
    return sim->external && fcsl_external_read_log(sim->external, text);
}

void fcsl_sim_count_commands(const fcsl_sim_t *sim, fcsl_external_counters_t *counters)
{
    *counters = sim->external ? fcsl_external_counters(sim->external) : (fcsl_external_counters_t){0};
}

int fcsl_sim_close(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (!sim) {
        return 0;
    }
    int status = 0;
    fcsl_sim_is_open(&sim->plant, 0);
    fcsl_sim_end_service(sim);
    fcsl_telemetry_close(sim->telemetry);
    fcsl_sim_publish_end(sim);
    fcsl_external_close(sim->external);
    fcsl_sim_topics_free(sim);
    fcsl_event_queue_free(&sim->queue);
    for (uint32_t i = 0; sim->companions && i < sim->companion_count; i++) {
        status = fcsl_companion_close(&sim->companions[i], error) != 0 ? -1 : status;
    }
    fcsl_assembly_free(sim);
    if (sim->run) {
        status = fcsl_run_close(sim->run, error) != 0 ? -1 : status;
    }
    fcsl_plan_free(&sim->plan);
    free(sim);
    return status;
}
