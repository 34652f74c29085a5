/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the devices of a plan and writes to them.
 */
#define _GNU_SOURCE
#include "outputs.h"

#include <dlfcn.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/error.h"
#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"

enum { LIST_BYTES = 200 };
static const char *const TYPES[] = {"bool", "i32", "i64", "u32", "u64", "f32", "f64"};

static const char *type_of(uint8_t type)
{
    return type < sizeof TYPES / sizeof TYPES[0] ? TYPES[type] : "another type";
}

/* The device of a plan's entry, which several entries may name; added when it is new. Null with `error`. */
static output_device_t *find_device(outputs_t *outputs, const plan_entry_t *entry, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = &outputs->devices[i];
        if (strcmp(device->name, entry->driver) == 0 && strcmp(device->device, entry->device) == 0) {
            return device;
        }
    }
    output_device_t *device = &outputs->devices[outputs->device_count];
    device->driver = fcsl_library_driver(entry->driver, FCSL_ACTUATOR, &device->library, error);
    if (device->driver == NULL) {
        return NULL;
    }
    outputs->device_count++;
    device->name = entry->driver;
    device->device = entry->device;
    const size_t align = device->driver->state_align < 64u ? 64u : device->driver->state_align;
    const size_t size = (device->driver->state_size + align - 1u) / align * align;
    device->state = aligned_alloc(align, size);
    device->used = calloc(device->driver->signal_count, 1);
    if (device->state == NULL || device->used == NULL) {
        (void)fcsl_fail(error, "out of memory for driver '%.100s'", entry->driver);
        return NULL;
    }
    memset(device->state, 0, size);
    return device;
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

static int bind(outputs_t *outputs, const plan_entry_t *entry, fcsl_error_t *error)
{
    const fcsl_channel_t *channel = &outputs->machine->channels[entry->channel];
    const fcsl_field_t *field = &outputs->machine->fields[channel->field];
    output_device_t *device = find_device(outputs, entry, error);
    if (device == NULL) {
        return -1;
    }
    const int64_t index = find_signal(device->driver, entry->signal, channel, field, error);
    if (index < 0) {
        return -1;
    }
    const fcsl_driver_signal_t *signal = &device->driver->signals[index];
    if (device->used[index] != 0u) {
        return fcsl_fail(error, "channel '%.60s': signal '%s' of %.100s:%.100s has another channel already",
                         channel->name, signal->name, device->name, device->device);
    }
    device->used[index] = 1;
    outputs->bindings[outputs->binding_count++] = (output_binding_t){.device = (uint32_t)(device - outputs->devices),
                                                                     .from = field->offset,
                                                                     .to = signal->offset,
                                                                     .size = field->size};
    return 0;
}

static int open_device(output_device_t *device, fcsl_error_t *error)
{
    const fcsl_driver_t *driver = device->driver;
    char why[OUTPUT_REASON_BYTES] = "";
    const char *what = "is not there";
    fcsl_driver_status_t status = driver->probe(device->device, why, sizeof why);
    if (status == FCSL_DRIVER_OK) {
        what = "cannot be opened";
        status = driver->open(device->state, device->device, device->used, why, sizeof why);
    }
    device->opened = status == FCSL_DRIVER_OK;
    why[sizeof why - 1u] = '\0';
    return device->opened ? 0
                          : fcsl_fail(error, "device '%.150s' of driver '%.150s' %s: %s", device->device, device->name,
                                      what, why[0] != '\0' ? why : "the driver gives no reason");
}

int outputs_open(const fcsl_machine_t *machine, const plan_entry_t *entries, uint32_t count, outputs_t *outputs,
                 fcsl_error_t *error)
{
    *outputs = (outputs_t){.machine = machine};
    outputs->devices = calloc(count + 1u, sizeof *outputs->devices);
    outputs->bindings = calloc(count + 1u, sizeof *outputs->bindings);
    if (outputs->devices == NULL || outputs->bindings == NULL) {
        return fcsl_fail(error, "out of memory for the devices");
    }
    for (uint32_t i = 0; i < count; i++) {
        if (entries[i].driver[0] != '\0' && bind(outputs, &entries[i], error) != 0) {
            return -1;
        }
    }
    int status = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        fcsl_error_t why;
        if (open_device(&outputs->devices[i], &why) != 0 && status == 0) {
            *error = why;
            status = -1;
        }
    }
    return status;
}

uint32_t outputs_write(outputs_t *outputs, const void *data)
{
    for (uint32_t i = 0; i < outputs->binding_count; i++) {
        const output_binding_t *binding = &outputs->bindings[i];
        const output_device_t *device = &outputs->devices[binding->device];
        memcpy((uint8_t *)device->state + binding->to, (const uint8_t *)data + binding->from, binding->size);
    }
    uint32_t failed = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = &outputs->devices[i];
        char why[OUTPUT_REASON_BYTES] = "";
        if (device->opened && device->driver->write(device->state, why, sizeof why) != FCSL_DRIVER_OK) {
            failed++;
            device->missed++;
            memcpy(device->reason, why, sizeof why - 1u);
        }
    }
    return failed;
}

uint64_t outputs_missed(const outputs_t *outputs)
{
    uint64_t missed = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        missed += outputs->devices[i].missed;
    }
    return missed;
}

void outputs_close(outputs_t *outputs)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = &outputs->devices[i];
        if (device->opened) {
            device->driver->close(device->state);
        }
        free(device->state);
        free(device->used);
        if (device->library != NULL) {
            (void)dlclose(device->library);
        }
    }
    free(outputs->devices);
    free(outputs->bindings);
    *outputs = (outputs_t){0};
}
