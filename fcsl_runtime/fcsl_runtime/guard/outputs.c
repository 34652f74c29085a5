/* SPDX-License-Identifier: Apache-2.0
 *
 * Hands values to the devices.
 */
#define _POSIX_C_SOURCE 200809L
#include "outputs.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_scalar.h"

enum { POLL_NS = 1000000 }; /* between two looks at devices that are waited for */
static const uint64_t END_NS = 1000000000u; /* for the threads to end */

int outputs_open(outputs_t *outputs, const fcsl_machine_t *machine, uint32_t devices, uint32_t bindings,
                 fcsl_error_t *error)
{
    *outputs = (outputs_t){.machine = machine};
    outputs->devices = calloc((size_t)devices + 1u, sizeof *outputs->devices);
    outputs->bindings = calloc((size_t)bindings + 1u, sizeof *outputs->bindings);
    return outputs->devices != NULL && outputs->bindings != NULL ? 0
                                                                 : fcsl_fail(error, "out of memory for the devices");
}

output_device_t *outputs_find_device(outputs_t *outputs, const char *driver, const char *address, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = outputs->devices[i];
        if (strcmp(output_device_driver_name(device), driver) == 0 &&
            strcmp(output_device_address(device), address) == 0) {
            return device;
        }
    }
    output_device_t *device = output_device_new(driver, address, error);
    if (device != NULL) {
        outputs->devices[outputs->device_count++] = device;
    }
    return device;
}

int outputs_bind(outputs_t *outputs, const output_binding_t *binding, uint32_t signal, fcsl_error_t *error)
{
    const fcsl_driver_signal_t *driven = &output_device_driver(binding->device)->signals[signal];
    if (output_device_use(binding->device, signal) != 0) {
        return fcsl_fail(error, "channel '%.60s': signal '%s' of %.100s:%.100s has another channel already",
                         binding->channel->name, driven->name, output_device_driver_name(binding->device),
                         output_device_address(binding->device));
    }
    output_binding_t *added = &outputs->bindings[outputs->binding_count++];
    *added = *binding;
    added->to = driven->offset;
    return 0;
}

/* ---- values --------------------------------------------------------------------------------------------------------- */

static void put_value(output_binding_t *binding, const uint8_t *data, int armed, uint64_t time_ns)
{
    uint8_t *to = (uint8_t *)output_device_values(binding->device) + binding->to;
    const uint8_t *from = data + binding->from;
    if (binding->rule == NULL) {
        memcpy(to, from, binding->size);
    } else {
        const double pulse =
            output_map_next(&binding->map, binding->rule, fcsl_scalar_as_double(from, binding->type), armed, time_ns);
        memcpy(to, &pulse, sizeof pulse);
    }
}

static void put_device(outputs_t *outputs, output_device_t *device, const void *data, int armed, uint64_t time_ns)
{
    for (uint32_t i = 0; i < outputs->binding_count; i++) {
        if (outputs->bindings[i].device == device) {
            put_value(&outputs->bindings[i], data, armed, time_ns);
        }
    }
    output_device_put(device, time_ns);
}

int outputs_start(outputs_t *outputs, const void *data, int priority, uint64_t timeout_ns, fcsl_error_t *error)
{
    int status = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = outputs->devices[i];
        fcsl_error_t why;
        if (output_device_start(device, priority, timeout_ns, &why) == 0) {
            put_device(outputs, device, data, 0, fcsl_monotonic_ns()); /* the next one may take its time to open */
        } else if (status == 0) {
            *error = why;
            status = -1;
        }
    }
    return status;
}

void outputs_put(outputs_t *outputs, const void *data, int armed, uint64_t time_ns)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        if (output_device_is_open(outputs->devices[i])) {
            put_device(outputs, outputs->devices[i], data, armed, time_ns);
        }
    }
}

/* ---- the safe values ------------------------------------------------------------------------------------------------ */

/* Hands the safe values to the devices that have written the last ones. */
static void put_safe(outputs_t *outputs, const void *data)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_t *device = outputs->devices[i];
        if (output_device_is_open(device) && !output_device_is_busy(device)) {
            put_device(outputs, device, data, 0, fcsl_monotonic_ns());
        }
    }
}

static void await(outputs_t *outputs)
{
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_await(outputs->devices[i]);
    }
}

static uint32_t count_missing(const outputs_t *outputs)
{
    uint32_t missing = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        missing += output_device_is_open(outputs->devices[i]) && !output_device_has_taken(outputs->devices[i]);
    }
    return missing;
}

uint32_t outputs_make_safe(outputs_t *outputs, const void *data, uint64_t period_ns, uint64_t limit_ns)
{
    const struct timespec pause = {.tv_nsec = POLL_NS};
    const uint64_t begin_ns = fcsl_monotonic_ns();
    uint64_t again_ns = begin_ns + period_ns;
    outputs_put(outputs, data, 0, begin_ns);
    await(outputs);
    uint32_t missing = count_missing(outputs);
    while (missing > 0u && fcsl_monotonic_ns() < begin_ns + limit_ns) {
        (void)nanosleep(&pause, NULL);
        missing = count_missing(outputs);
        if (missing > 0u && fcsl_monotonic_ns() >= again_ns) {
            put_safe(outputs, data);
            again_ns = fcsl_monotonic_ns() + period_ns;
        }
    }
    return missing;
}

uint64_t outputs_missed(const outputs_t *outputs)
{
    uint64_t missed = 0;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        missed += output_device_missed(outputs->devices[i]);
    }
    return missed;
}

void outputs_close(outputs_t *outputs)
{
    const uint64_t until_ns = fcsl_monotonic_ns() + END_NS;
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_end(outputs->devices[i]);
    }
    for (uint32_t i = 0; i < outputs->device_count; i++) {
        output_device_free(outputs->devices[i], until_ns);
    }
    free(outputs->devices);
    free(outputs->bindings);
    *outputs = (outputs_t){0};
}
