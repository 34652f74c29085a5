/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor of a board.
 */
#include "board_sensor.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_channels.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_tick_time.h"

static int bind(board_sensor_run_t *sensor, const board_binding_t *binding, board_channel_t *bound,
                const fcsl_machine_t *machine, fcsl_error_t *error)
{
    fcsl_frontend_config_t *config = &sensor->plan->config;
    const fcsl_quantity_t *quantity = &fcsl_sensor_kinds[config->kind].quantities[binding->quantity];
    const fcsl_channel_t *channel = fcsl_find_channel(machine, binding->channel, strlen(binding->channel));
    if (channel == NULL) {
        return fcsl_fail(error, "machine '%.60s' has no channel '%.100s': the plan was made for another one",
                         machine->name, binding->channel);
    }
    bound->channel = (uint32_t)(channel - machine->channels);
    const fcsl_field_t *field = &machine->fields[channel->field];
    const int is_float = field->type == FCSL_F64 || field->type == FCSL_F32;
    const int fits = field->count == quantity->count || (config->kind == FCSL_RC && field->count < quantity->count);
    if (channel->direction != FCSL_SENSOR || !is_float || !fits) {
        return fcsl_fail(
            error, "channel '%.100s' is no sensor of %u floating-point numbers: the plan was made for another machine",
            channel->name, quantity->count);
    }
    if (config->kind != FCSL_RC && quantity->unit[0] != '\0' && field->unit[0] != '\0' &&
        strcmp(quantity->unit, field->unit) != 0) {
        return fcsl_fail(
            error,
            "channel '%.100s' is in %.40s, and sensor '%.60s' gives %.40s: the plan was made for another machine",
            channel->name, field->unit, sensor->plan->name, quantity->unit);
    }
    bound->at = quantity->at;
    bound->count = field->count;
    bound->type = field->type;
    if (quantity->given && config->needed[binding->quantity] < field->count) {
        config->needed[binding->quantity] = field->count;
    }
    return 0;
}

/* What is computed needs all of what it is computed from. */
static void need_inputs(board_sensor_t *plan)
{
    const fcsl_sensor_kind_info_t *kind = &fcsl_sensor_kinds[plan->config.kind];
    for (uint32_t q = 0; q < kind->quantity_count; q++) {
        if (kind->quantities[q].given && plan->config.needed[q] == 0u && board_sensor_needs(plan, q)) {
            plan->config.needed[q] = plan->config.kind == FCSL_RC ? 1u : kind->quantities[q].count;
        }
    }
}

int board_sensor_open(board_sensor_run_t *sensor, board_sensor_t *plan, const fcsl_machine_t *machine,
                      fcsl_error_t *error)
{
    sensor->plan = plan;
    sensor->output.primary = -1;
    sensor->frontend = calloc(1, fcsl_frontend_bytes());
    if (sensor->frontend == NULL) {
        return fcsl_fail(error, "out of memory for sensor '%.60s'", plan->name);
    }
    for (uint32_t i = 0; machine != NULL && i < plan->binding_count; i++) {
        if (bind(sensor, &plan->bindings[i], &sensor->channels[i], machine, error) != 0) {
            return -1;
        }
    }
    need_inputs(plan);
    fcsl_frontend_init(sensor->frontend, &plan->config);
    return 0;
}

static uint32_t put_values(const board_channel_t *channel, const double *values, uint8_t *bytes)
{
    if (channel->type == FCSL_F64) {
        fcsl_scalars_export(bytes, values, FCSL_F64, channel->count);
        return channel->count * (uint32_t)sizeof(double);
    }
    float narrow[FCSL_VALUES_MAX];
    for (uint32_t i = 0; i < channel->count; i++) {
        narrow[i] = (float)values[i];
    }
    fcsl_scalars_export(bytes, narrow, FCSL_F32, channel->count);
    return channel->count * (uint32_t)sizeof(float);
}

int board_sensor_tick(board_sensor_run_t *sensor, fcsl_run_t *run, uint64_t now_ns, fcsl_error_t *error)
{
    const fcsl_frontend_output_t *output = &sensor->output;
    fcsl_frontend_tick(sensor->frontend, now_ns, &sensor->output);
    if (run == NULL || output->primary < 0 || !output->fresh) {
        return 0;
    }
    const uint64_t age_ns = now_ns > output->sample_ns ? now_ns - output->sample_ns : 0u;
    const uint32_t age_ticks = fcsl_ticks_of(fcsl_run_machine(run)->tick_hz, age_ns);
    for (uint32_t i = 0; i < sensor->plan->binding_count; i++) {
        uint8_t bytes[FCSL_VALUES_MAX * sizeof(double)];
        const board_channel_t *channel = &sensor->channels[i];
        const uint32_t size = put_values(channel, &output->values[channel->at], bytes);
        if (fcsl_run_write_channel(run, channel->channel, bytes, size, age_ticks, (int64_t)output->sample_ns, error) !=
            0) {
            return -1;
        }
    }
    return 0;
}

void board_sensor_close(board_sensor_run_t *sensor)
{
    free(sensor->frontend);
    sensor->frontend = NULL;
}
