/* SPDX-License-Identifier: Apache-2.0
 *
 * Binds the elements of channels to the outputs of a board.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_channels.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_scalar.h"
#include "outputs.h"

/* The driver's signal of this name, which must be a double. Returns its index, or -1. */
static int64_t find_pulse_signal(const fcsl_driver_t *driver, const char *name)
{
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        const fcsl_driver_signal_t *signal = &driver->signals[i];
        if (strcmp(signal->name, name) == 0) {
            return signal->type == FCSL_F64 && signal->count == 1u ? (int64_t)i : -1;
        }
    }
    return -1;
}

static int add_pulse(outputs_t *outputs, output_device_t *device, const fcsl_channel_t *channel,
                     const board_pulse_t *rule, fcsl_error_t *error)
{
    const fcsl_field_t *field = &outputs->machine->fields[channel->field];
    const uint32_t scalar = fcsl_scalar_size(field->type);
    const char *flaw = output_map_flaw(rule);
    if (field->type > FCSL_F64 || rule->index >= field->count) {
        return fcsl_fail(error, "output '%.60s' has a pulse of element %" PRIu32 ", which the channel lacks",
                         channel->name, rule->index);
    }
    if (flaw != NULL) {
        return fcsl_fail(error, "output '%.60s', the pulse of element %" PRIu32 ": %s", channel->name, rule->index,
                         flaw);
    }
    const int64_t signal = find_pulse_signal(output_device_driver(device), rule->signal);
    if (signal < 0) {
        return fcsl_fail(error, "output '%.60s': driver '%.60s' has no signal '%.60s' that is one f64", channel->name,
                         output_device_driver_name(device), rule->signal);
    }
    const output_binding_t binding = {.device = device,
                                      .channel = channel,
                                      .from = field->offset + rule->index * scalar,
                                      .size = scalar,
                                      .type = field->type,
                                      .rule = rule,
                                      .map = output_map(rule, fcsl_monotonic_ns())};
    return outputs_bind(outputs, &binding, (uint32_t)signal, error);
}

static int add_output(outputs_t *outputs, const board_plan_t *plan, const board_output_t *output, fcsl_error_t *error)
{
    const board_device_t *device = &plan->devices[output->device];
    const fcsl_channel_t *channel = fcsl_find_channel(outputs->machine, output->channel, strlen(output->channel));
    if (channel == NULL || channel->direction != FCSL_ACTUATOR) {
        return fcsl_fail(error, "output '%.60s': machine '%.60s' has no such actuator channel", output->channel,
                         outputs->machine->name);
    }
    fcsl_error_t why;
    output_device_t *opened = outputs_find_device(outputs, device->driver, device->address, &why);
    if (opened == NULL) {
        return fcsl_fail(error, "device '%.60s': %.400s", device->name, why.text);
    }
    for (uint32_t i = 0; i < output->pulse_count; i++) {
        if (add_pulse(outputs, opened, channel, &output->pulses[i], error) != 0) {
            return -1;
        }
    }
    return 0;
}

static int has_pulse(const outputs_t *outputs, const fcsl_channel_t *channel, uint32_t index)
{
    for (uint32_t i = 0; i < outputs->binding_count; i++) {
        if (outputs->bindings[i].channel == channel && outputs->bindings[i].rule->index == index) {
            return 1;
        }
    }
    return 0;
}

static int is_undriven(const board_plan_t *plan, const fcsl_channel_t *channel)
{
    for (uint32_t i = 0; i < plan->undriven_count; i++) {
        if (strcmp(plan->undriven[i], channel->name) == 0) {
            return 1;
        }
    }
    return 0;
}

/* An actuator that nothing drives would be found in flight, unless the board says so. */
static int check_all_driven(const outputs_t *outputs, const board_plan_t *plan, const char *file, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = outputs->machine;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const int is_meant = channel->direction == FCSL_ACTUATOR && !is_undriven(plan, channel);
        const uint32_t count = is_meant ? machine->fields[channel->field].count : 0u;
        for (uint32_t index = 0; index < count; index++) {
            if (!has_pulse(outputs, channel, index)) {
                return fcsl_fail(error,
                                 "element %" PRIu32 " of channel '%.60s' has no output in '%.200s': with --board every "
                                 "actuator channel needs one in the plan, for each of its elements, or null",
                                 index, channel->name, file);
            }
        }
    }
    return 0;
}

int outputs_add_board(outputs_t *outputs, const board_plan_t *plan, const char *file, fcsl_error_t *error)
{
    if (board_plan_check_machine(plan, file, outputs->machine, error) != 0) {
        return -1;
    }
    for (uint32_t i = 0; i < plan->output_count; i++) {
        if (add_output(outputs, plan, &plan->outputs[i], error) != 0) {
            return -1;
        }
    }
    return check_all_driven(outputs, plan, file, error);
}
