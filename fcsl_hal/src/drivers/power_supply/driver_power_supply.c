/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `power_supply`: a battery, or another supply that the kernel knows
 * (Documentation/ABI/testing/sysfs-class-power of the kernel).
 */
#define _POSIX_C_SOURCE 200809L
#include "fcsl/fcsl_driver.h"
#include "sysfs/sysfs.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

typedef enum { VOLTAGE, CURRENT, CHARGE, TEMPERATURE, SIGNALS } signal_t;

typedef struct {
    double voltage;
    double current;
    double charge;
    double temperature;
    int files[SIGNALS]; /* -1: not used */
    int status_file; /* -1: none */
} power_supply_t;

static const fcsl_driver_signal_t signals[SIGNALS] = {
    [VOLTAGE] = FCSL_DRIVER_SIGNAL(power_supply_t, voltage, "V", "voltage of the battery"),
    [CURRENT] = FCSL_DRIVER_SIGNAL(power_supply_t, current, "A", "current, positive: out of the battery"),
    [CHARGE] = FCSL_DRIVER_SIGNAL(power_supply_t, charge, "", "what is left of its charge, 0 to 1; NaN: not known"),
    [TEMPERATURE] = FCSL_DRIVER_SIGNAL(power_supply_t, temperature, "degC", "temperature of the battery"),
};

static const struct {
    const char *name;
    double per_unit; /* of the attribute, one of the signal's unit */
} ATTRIBUTES[SIGNALS] = {
    [VOLTAGE] = {"voltage_now", 1e6}, /* uV */
    [CURRENT] = {"current_now", 1e6}, /* uA */
    [CHARGE] = {"capacity", 1e2}, /* % */
    [TEMPERATURE] = {"temp", 1e1}, /* tenths of a degree */
};

static const char *const names[] = {NULL};
static const sysfs_class_t supplies = {
    .noun = "power supply", .folder = "class/power_supply", .prefix = "", .names = names};

static fcsl_driver_status_t probe_power_supply(const char *device, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    return sysfs_find(&supplies, device, path, why, size);
}

static void close_power_supply(void *self)
{
    power_supply_t *supply = self;
    for (uint32_t i = 0; i < SIGNALS; i++) {
        if (supply->files[i] >= 0) {
            (void)close(supply->files[i]);
        }
    }
    if (supply->status_file >= 0) {
        (void)close(supply->status_file);
    }
}

static fcsl_driver_status_t open_files(power_supply_t *supply, const char *path, const uint8_t *used, char *why,
                                       size_t size)
{
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    for (uint32_t i = 0; i < SIGNALS && status == FCSL_DRIVER_OK; i++) {
        if (used[i] != 0u) {
            status = sysfs_open(path, ATTRIBUTES[i].name, &supply->files[i], why, size);
        }
        if (status == FCSL_DRIVER_NOTHING && used[i] == FCSL_DRIVER_OPTIONAL) {
            status = FCSL_DRIVER_OK; /* its value stays NaN */
        }
        if (status == FCSL_DRIVER_NOTHING) {
            (void)snprintf(why, size, "'%s' has no %s", path, ATTRIBUTES[i].name);
            status = FCSL_DRIVER_FAILED;
        }
    }
    if (status == FCSL_DRIVER_OK && used[CURRENT] != 0u) {
        status = sysfs_open(path, "status", &supply->status_file, why, size);
    }
    return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_OK : status;
}

static fcsl_driver_status_t open_power_supply(void *self, const char *device, const uint8_t *used, char *why,
                                              size_t size)
{
    power_supply_t *supply = self;
    char path[SYSFS_PATH_BYTES];
    fcsl_driver_status_t status = sysfs_find(&supplies, device, path, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    for (uint32_t i = 0; i < SIGNALS; i++) {
        supply->files[i] = -1;
    }
    supply->status_file = -1;
    supply->voltage = NAN;
    supply->current = NAN;
    supply->charge = NAN;
    supply->temperature = NAN;
    status = open_files(supply, path, used, why, size);
    if (status != FCSL_DRIVER_OK) {
        close_power_supply(supply);
    }
    return status;
}

/* The kernel says that current_now is negative while the battery discharges, and many of its drivers give no sign: status, where
 * it says which, decides. */
static fcsl_driver_status_t fix_sign(const power_supply_t *supply, double *current, char *why, size_t size)
{
    char text[SYSFS_TEXT_BYTES] = "";
    if (supply->status_file >= 0) {
        const fcsl_driver_status_t status = sysfs_read_text(supply->status_file, "status", text, why, size);
        if (status != FCSL_DRIVER_OK) {
            return status;
        }
    }
    if (strcmp(text, "Charging") == 0) {
        *current = -fabs(*current);
    } else if (strcmp(text, "Discharging") == 0) {
        *current = fabs(*current);
    } else {
        *current = -*current;
    }
    return FCSL_DRIVER_OK;
}

/* The kernel's capacity is 0 to 100 %; fuel gauges that know none give 255, or another number beyond. */
static double charge_of(double percent)
{
    return percent >= 0.0 && percent <= 100.0 ? percent : (double)NAN;
}

static fcsl_driver_status_t read_power_supply(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    power_supply_t *supply = self;
    double values[SIGNALS] = {supply->voltage, supply->current, supply->charge, supply->temperature};
    const uint64_t begin_ns = fcsl_monotonic_ns();
    for (uint32_t i = 0; i < SIGNALS; i++) {
        if (supply->files[i] < 0) {
            continue;
        }
        fcsl_driver_status_t status = sysfs_read_number(supply->files[i], ATTRIBUTES[i].name, &values[i], why, size);
        if (status == FCSL_DRIVER_OK && i == CURRENT) {
            status = fix_sign(supply, &values[i], why, size);
        }
        if (status != FCSL_DRIVER_OK) {
            return status;
        }
        values[i] = (i == CHARGE ? charge_of(values[i]) : values[i]) / ATTRIBUTES[i].per_unit;
    }
    supply->voltage = values[VOLTAGE];
    supply->current = values[CURRENT];
    supply->charge = values[CHARGE];
    supply->temperature = values[TEMPERATURE];
    *sample_ns = begin_ns;
    return FCSL_DRIVER_OK;
}

const fcsl_driver_t fcsl_driver_power_supply = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "power_supply",
    .doc = "battery of Linux, polled; power_supply:DEVICE, its folder in /sys/class/power_supply or the folder's name",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = SIGNALS,
    .state_size = sizeof(power_supply_t),
    .state_align = _Alignof(power_supply_t),
    .waits = 0,
    .probe = probe_power_supply,
    .open = open_power_supply,
    .read = read_power_supply,
    .close = close_power_supply,
};
