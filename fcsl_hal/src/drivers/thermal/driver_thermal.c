/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `thermal`: a thermal zone of the kernel, a temperature of the computer itself.
 */
#define _POSIX_C_SOURCE 200809L
#include "fcsl/fcsl_driver.h"
#include "sysfs/sysfs.h"

#include <stdio.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

static const double MILLI_PER_ONE = 1e3;

typedef struct {
    double value;
    int file;
} thermal_t;

static const fcsl_driver_signal_t signals[] = {
    FCSL_DRIVER_SIGNAL(thermal_t, value, "degC", "temperature of the zone"),
};

static const char *const names[] = {"type", NULL};
static const sysfs_class_t zones = {
    .noun = "thermal zone", .folder = "class/thermal", .prefix = "thermal_zone", .names = names};

static fcsl_driver_status_t probe_thermal(const char *device, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    return sysfs_find(&zones, device, path, why, size);
}

static fcsl_driver_status_t open_thermal(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used; /* it has one signal */
    thermal_t *thermal = self;
    char path[SYSFS_PATH_BYTES];
    fcsl_driver_status_t status = sysfs_find(&zones, device, path, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = sysfs_open(path, "temp", &thermal->file, why, size);
    }
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "'%s' is no thermal zone: it has no temp", path);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

static fcsl_driver_status_t read_thermal(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    thermal_t *thermal = self;
    double millidegrees = 0.0;
    const uint64_t begin_ns = fcsl_monotonic_ns();
    const fcsl_driver_status_t status = sysfs_read_number(thermal->file, "temp", &millidegrees, why, size);
    if (status == FCSL_DRIVER_OK) {
        thermal->value = millidegrees / MILLI_PER_ONE;
        *sample_ns = begin_ns;
    }
    return status;
}

static void close_thermal(void *self)
{
    (void)close(((thermal_t *)self)->file);
}

const fcsl_driver_t fcsl_driver_thermal = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "thermal",
    .doc = "thermal zone of Linux, polled; thermal:DEVICE, its type or its folder in /sys/class/thermal",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = sizeof signals / sizeof signals[0],
    .state_size = sizeof(thermal_t),
    .state_align = _Alignof(thermal_t),
    .waits = 0,
    .probe = probe_thermal,
    .open = open_thermal,
    .read = read_thermal,
    .close = close_thermal,
};
