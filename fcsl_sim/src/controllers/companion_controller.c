/* SPDX-License-Identifier: Apache-2.0
 *
 * Controllers beside the first one.
 */
#include "companion_controller.h"

#include <stdlib.h>
#include <string.h>

#include "base/aligned_memory.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"

int fcsl_companion_open(fcsl_companion_t *companion, const fcsl_plan_companion_t *plan,
                        const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    companion->name = plan->name;
    companion->run = fcsl_run_open(plan->library, plan->machine, parameters, error);
    if (!companion->run) {
        return -1;
    }
    const fcsl_machine_t *machine = fcsl_run_machine(companion->run);
    companion->machine = machine;
    if (machine->tick_hz == 0) {
        return fcsl_fail(error, "plan line %u: the machine does not tick", plan->line);
    }
    const size_t sensors = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    const size_t actuators = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    companion->capacity = sensors > actuators ? sensors : actuators;
    companion->bytes = malloc(companion->capacity);
    companion->image = fcsl_sim_allocate(machine->size, machine->align);
    companion->select = calloc(machine->channel_count + 1u, 1);
    if (!companion->bytes || !companion->image || !companion->select ||
        fcsl_delay_open(&companion->delay, plan->delay_ticks, companion->capacity)) {
        return fcsl_fail(error, "no memory for controller `%s`", plan->name);
    }
    companion->gate = fcsl_gate(machine, companion->image);
    return 0;
}

int fcsl_companion_start(fcsl_companion_t *companion, fcsl_error_t *error)
{
    return fcsl_run_attach(companion->run, error);
}

int fcsl_companion_close(fcsl_companion_t *companion, fcsl_error_t *error)
{
    const int status = companion->run ? fcsl_run_close(companion->run, error) : 0;
    fcsl_delay_free(&companion->delay);
    free(companion->bytes);
    free(companion->image);
    free(companion->select);
    free(companion->sensors);
    *companion = (fcsl_companion_t){0};
    return status;
}

void fcsl_sensors_sample(const fcsl_plant_t *plant, fcsl_sensor_t *sensors, uint32_t count, uint8_t *select,
                         uint32_t channels)
{
    memset(select, 0, channels);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_sensor_t *sensor = &sensors[i];
        const uint64_t samples = plant->instances[sensor->instance].samples;
        if (plant->time_ns < sensor->first_ns) {
            sensor->samples = samples;
        } else if (samples != sensor->samples) {
            memcpy(sensor->to, sensor->from, sensor->size);
            select[sensor->channel] = 1;
            sensor->samples = samples;
        }
    }
}

int fcsl_companion_tick(fcsl_companion_t *companion, fcsl_plant_t *plant, fcsl_error_t *error)
{
    const fcsl_channel_table_t *channels = fcsl_run_channels(companion->run);
    const uint64_t now_ns = (uint64_t)plant->time_ns;
    fcsl_message_t message;
    fcsl_message_t due;
    fcsl_sensors_sample(plant, companion->sensors, companion->sensor_count, companion->select,
                        companion->machine->channel_count);
    if (fcsl_message_encode_sensors(channels, companion->image, companion->tick, companion->select, companion->bytes,
                                    companion->capacity, &message) != FCSL_MESSAGE_OK) {
        return fcsl_fail(error, "controller `%s`: there is no sensor message of its channels", companion->name);
    }
    if (fcsl_run_sense_message(companion->run, &message, error) || fcsl_run_step(companion->run, 1, error)) {
        return -1;
    }
    if (fcsl_run_actuate_message(companion->run, companion->bytes, companion->capacity, &message) != 0) {
        return fcsl_fail(error, "controller `%s`: an actuator channel holds what its type does not have",
                         companion->name);
    }
    fcsl_gate_wait(&companion->gate, now_ns, companion->image);
    if (fcsl_delay_pass(&companion->delay, channels, companion->tick, &message, &due)) {
        const int64_t made_ns = fcsl_grid_time_ns(due.tick, companion->machine->tick_hz);
        fcsl_gate_command(&companion->gate, &due, (uint64_t)made_ns, companion->image);
        fcsl_gate_wait(&companion->gate, now_ns, companion->image);
    }
    companion->tick++;
    companion->next_tick_ns = fcsl_grid_time_ns(companion->tick, companion->machine->tick_hz);
    return 0;
}
