/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `adc`: the raw counts of an analog-digital converter of the kernel's industrial I/O, read value by value from sysfs.
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

#include "fcsl/fcsl_driver.h"
#include "iio.h"

enum { INPUTS = 16 };

typedef struct {
    double counts[INPUTS];
    int files[INPUTS]; /* -1: not used */
} adc_t;

#define COUNTS(index_)                                                                                                 \
    {.name = "counts" #index_,                                                                                         \
     .type = FCSL_F64,                                                                                                 \
     .count = 1,                                                                                                       \
     .offset = offsetof(adc_t, counts) + (index_) * sizeof(double),                                                    \
     .unit = "",                                                                                                       \
     .doc = "what input " #index_ " of the converter reads, without a unit"}

static const fcsl_driver_signal_t signals[INPUTS] = {
    COUNTS(0), COUNTS(1), COUNTS(2),  COUNTS(3),  COUNTS(4),  COUNTS(5),  COUNTS(6),  COUNTS(7),
    COUNTS(8), COUNTS(9), COUNTS(10), COUNTS(11), COUNTS(12), COUNTS(13), COUNTS(14), COUNTS(15),
};

static void name_input(unsigned index, char name[IIO_ATTRIBUTE_BYTES])
{
    (void)snprintf(name, IIO_ATTRIBUTE_BYTES, "in_voltage%u_raw", index);
}

static fcsl_driver_status_t probe_adc(const char *device, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    return sysfs_find(&iio_devices, device, path, why, size);
}

static void close_adc(void *self)
{
    const adc_t *adc = self;
    for (unsigned i = 0; i < INPUTS; i++) {
        if (adc->files[i] >= 0) {
            (void)close(adc->files[i]);
        }
    }
}

static fcsl_driver_status_t open_input(adc_t *adc, const char *folder, unsigned index, char *why, size_t size)
{
    char name[IIO_ATTRIBUTE_BYTES];
    name_input(index, name);
    const fcsl_driver_status_t status = sysfs_open(folder, name, &adc->files[index], why, size);
    if (status == FCSL_DRIVER_OK) {
        return status;
    }
    adc->files[index] = -1;
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "the device has no input %u: '%s' has no %s", index, folder, name);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

static fcsl_driver_status_t open_adc(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    adc_t *adc = self;
    char folder[SYSFS_PATH_BYTES];
    for (unsigned i = 0; i < INPUTS; i++) {
        adc->files[i] = -1;
    }
    fcsl_driver_status_t status = sysfs_find(&iio_devices, device, folder, why, size);
    for (unsigned i = 0; i < INPUTS && status == FCSL_DRIVER_OK; i++) {
        if (used[i] != FCSL_DRIVER_UNUSED) {
            status = open_input(adc, folder, i, why, size);
        }
    }
    if (status != FCSL_DRIVER_OK) {
        close_adc(adc);
    }
    return status;
}

static fcsl_driver_status_t read_adc(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    adc_t *adc = self;
    double counts[INPUTS] = {0.0};
    const uint64_t begin_ns = fcsl_monotonic_ns();
    for (unsigned i = 0; i < INPUTS; i++) {
        char name[IIO_ATTRIBUTE_BYTES];
        name_input(i, name);
        if (adc->files[i] < 0) {
            continue;
        }
        const fcsl_driver_status_t status = sysfs_read_number(adc->files[i], name, &counts[i], why, size);
        if (status != FCSL_DRIVER_OK) {
            return status;
        }
    }
    for (unsigned i = 0; i < INPUTS; i++) {
        adc->counts[i] = counts[i];
    }
    *sample_ns = begin_ns;
    return FCSL_DRIVER_OK;
}

const fcsl_driver_t fcsl_driver_adc = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "adc",
    .doc = "raw counts of a converter of Linux IIO, polled; adc:DEVICE, its name, its label or its folder",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = INPUTS,
    .state_size = sizeof(adc_t),
    .state_align = _Alignof(adc_t),
    .waits = 0,
    .probe = probe_adc,
    .open = open_adc,
    .read = read_adc,
    .close = close_adc,
};
