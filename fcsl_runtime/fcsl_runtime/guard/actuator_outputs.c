/* SPDX-License-Identifier: Apache-2.0
 *
 * Binds the channels that --actuator names to signals of devices.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "outputs.h"

enum { LIST_BYTES = 200 };
static const char *const TYPES[] = {"bool", "i32", "i64", "u32", "u64", "f32", "f64"};

static const char *type_of(uint8_t type)
{
    return type < sizeof TYPES / sizeof TYPES[0] ? TYPES[type] : "another type";
}

static void list_signals(const fcsl_driver_t *driver, char *text, size_t size)
{
    size_t at = 0;
    text[0] = '\0';
    for (uint32_t i = 0; i < driver->signal_count && at < size; i++) {
        const fcsl_driver_signal_t *signal = &driver->signals[i];
        const int length = snprintf(text + at, size - at, "%s%s (%s × %" PRIu32 ")", i > 0u ? ", " : "", signal->name,
                                    type_of(signal->type), signal->count);
        at += length > 0 ? (size_t)length : 0u;
    }
}

static int fits(const fcsl_driver_signal_t *signal, const fcsl_field_t *field)
{
    return signal->type == field->type && signal->count == field->count;
}
/* The named signal, or the only one that fits. Returns its index, or -1. */
static int64_t find_signal(const fcsl_driver_t *driver, const char *name, const fcsl_channel_t *channel,
                           const fcsl_field_t *field, fcsl_error_t *error)
{
    int64_t found = -1;
    uint32_t matches = 0;
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        const fcsl_driver_signal_t *signal = &driver->signals[i];
        if (name[0] != '\0' ? strcmp(signal->name, name) == 0 : fits(signal, field)) {
            found = (int64_t)i;
            matches++;
        }
    }
    char signals[LIST_BYTES];
    list_signals(driver, signals, sizeof signals);
    if (matches == 0u) {
        return fcsl_fail(error,
                         "channel '%.60s' (%s × %" PRIu32 "): driver '%s' has no signal %.60s; its signals are: %s",
                         channel->name, type_of(field->type), field->count, driver->name,
                         name[0] != '\0' ? name : "of this type", signals);
    }
    if (matches > 1u) {
        return fcsl_fail(error, "channel '%.60s': several signals of driver '%s' fit, name one as %s.SIGNAL: %s",
                         channel->name, driver->name, driver->name, signals);
    }
    const fcsl_driver_signal_t *signal = &driver->signals[found];
    if (!fits(signal, field)) {
        return fcsl_fail(error, "channel '%.60s' is %s × %" PRIu32 ", signal '%s' of driver '%s' is %s × %" PRIu32,
                         channel->name, type_of(field->type), field->count, signal->name, driver->name,
                         type_of(signal->type), signal->count);
    }
    if (field->unit[0] != '\0' && signal->unit[0] != '\0' && strcmp(field->unit, signal->unit) != 0) {
        return fcsl_fail(error, "channel '%.60s' is in %.40s, signal '%s' of driver '%s' in %s", channel->name,
                         field->unit, signal->name, driver->name, signal->unit);
    }
    return found;
}

static int add_assignment(outputs_t *outputs, const output_assignment_t *assignment, fcsl_error_t *error)
{
    const fcsl_channel_t *channel = &outputs->machine->channels[assignment->channel];
    const fcsl_field_t *field = &outputs->machine->fields[channel->field];
    output_device_t *device = outputs_find_device(outputs, assignment->driver, assignment->device, error);
    if (device == NULL) {
        return -1;
    }
    const int64_t signal = find_signal(output_device_driver(device), assignment->signal, channel, field, error);
    if (signal < 0) {
        return -1;
    }
    const output_binding_t binding = {
        .device = device, .channel = channel, .from = field->offset, .size = field->size, .type = field->type};
    return outputs_bind(outputs, &binding, (uint32_t)signal, error);
}

int outputs_add_actuators(outputs_t *outputs, const output_assignment_t *assignments, uint32_t count,
                          fcsl_error_t *error)
{
    for (uint32_t i = 0; i < count; i++) {
        if (assignments[i].driver[0] != '\0' && add_assignment(outputs, &assignments[i], error) != 0) {
            return -1;
        }
    }
    return 0;
}
