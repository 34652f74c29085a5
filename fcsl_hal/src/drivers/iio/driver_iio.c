/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `iio`: a sensor of the kernel's industrial I/O, read value by value from sysfs.
 */
#define _POSIX_C_SOURCE 200809L
#include "fcsl/fcsl_driver.h"
#include "iio.h"

#include <stdio.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

typedef struct {
    const iio_channel_t *channel;
    iio_conversion_t conversion;
    int file;
} input_t;

typedef struct {
    iio_values_t values; /* the signals */
    input_t inputs[IIO_VALUES];
    uint32_t input_count;
    iio_mounts_t mounts;
    char folder[SYSFS_PATH_BYTES];
} iio_t;

static fcsl_driver_status_t probe_iio(const char *device, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    return sysfs_find(&iio_devices, device, path, why, size);
}

static void close_iio(void *self)
{
    iio_t *iio = self;
    for (uint32_t i = 0; i < iio->input_count; i++) {
        (void)close(iio->inputs[i].file);
    }
}

/* Opens in_accel_x_raw, or in_accel_x_input, whose numbers have their scale already. */
static fcsl_driver_status_t open_input(const char *folder, const iio_channel_t *channel, input_t *input, char *why,
                                       size_t size)
{
    char attribute[IIO_ATTRIBUTE_BYTES];
    (void)snprintf(attribute, sizeof attribute, "%s_raw", channel->name);
    fcsl_driver_status_t status = sysfs_open(folder, attribute, &input->file, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = iio_get_conversion(folder, channel, &input->conversion, why, size);
        if (status != FCSL_DRIVER_OK) {
            (void)close(input->file);
        }
        return status;
    }
    if (status != FCSL_DRIVER_NOTHING || channel->scale_required != 0u) {
        return status;
    }
    (void)snprintf(attribute, sizeof attribute, "%s_input", channel->name);
    input->conversion = (iio_conversion_t){.offset = 0.0, .scale = 1.0};
    return sysfs_open(folder, attribute, &input->file, why, size);
}

static fcsl_driver_status_t add_input(void *self, const iio_channel_t *channel, char *why, size_t size)
{
    iio_t *iio = self;
    input_t *input = &iio->inputs[iio->input_count];
    const fcsl_driver_status_t status = open_input(iio->folder, channel, input, why, size);
    if (status == FCSL_DRIVER_OK) {
        input->channel = channel;
        iio->input_count++;
    }
    return status;
}

static fcsl_driver_status_t open_iio(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    iio_t *iio = self;
    fcsl_driver_status_t status = sysfs_find(&iio_devices, device, iio->folder, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = iio_get_mounts(iio->folder, used, &iio->mounts, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = iio_add_channels(iio, used, add_input, &iio->values, why, size);
    }
    if (status != FCSL_DRIVER_OK) {
        close_iio(iio);
    }
    return status;
}

static fcsl_driver_status_t read_iio(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    iio_t *iio = self;
    iio_values_t values = iio->values;
    const uint64_t begin_ns = fcsl_monotonic_ns();
    for (uint32_t i = 0; i < iio->input_count; i++) {
        const input_t *input = &iio->inputs[i];
        double raw = 0.0;
        const fcsl_driver_status_t status = sysfs_read_number(input->file, input->channel->name, &raw, why, size);
        if (status != FCSL_DRIVER_OK) {
            return status;
        }
        iio_put_value(&values, input->channel, &input->conversion, raw);
    }
    iio_turn(&iio->mounts, &values);
    iio->values = values;
    *sample_ns = begin_ns;
    return FCSL_DRIVER_OK;
}

const fcsl_driver_t fcsl_driver_iio = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "iio",
    .doc = "sensor of Linux IIO, polled; iio:DEVICE, its name, its label or its folder in /sys/bus/iio/devices",
    .direction = FCSL_SENSOR,
    .signals = iio_signals,
    .signal_count = IIO_SIGNALS,
    .state_size = sizeof(iio_t),
    .state_align = _Alignof(iio_t),
    .waits = 0,
    .probe = probe_iio,
    .open = open_iio,
    .read = read_iio,
    .close = close_iio,
};
