/* SPDX-License-Identifier: Apache-2.0
 *
 * Triggers of IIO buffers. A timer trigger is made in configfs, which is at /sys/kernel/config or where the environment's
 * FCSL_CONFIGFS says; it stays there, and is used again.
 */
#define _POSIX_C_SOURCE 200809L
#include "iio_trigger.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

enum { TRIGGER_BYTES = SYSFS_TEXT_BYTES + 16, TIMER_MODE = 0755 };

static const char RATE[] = "sampling_frequency";
static const char CURRENT_TRIGGER[] = "trigger/current_trigger";

static const char *const names[] = {"name", NULL};
static const sysfs_class_t triggers = {
    .noun = "IIO trigger", .folder = "bus/iio/devices", .prefix = "trigger", .names = names};

/* ---- rate --------------------------------------------------------------------------------------------------------------- */

/* Writes the rate of the device, or of the used types of channels where each has its own. NOTHING: there is none to set. */
static fcsl_driver_status_t set_device_rate(const iio_setup_t *setup, char *why, size_t size)
{
    fcsl_driver_status_t result = sysfs_put_text(setup->folder, RATE, setup->rate, why, size);
    if (result != FCSL_DRIVER_NOTHING) {
        return result;
    }
    for (uint32_t i = 0; i < setup->element_count; i++) {
        char attribute[IIO_ATTRIBUTE_BYTES];
        const iio_channel_t *channel = setup->elements[i].channel;
        if (channel == NULL) {
            continue;
        }
        (void)snprintf(attribute, sizeof attribute, "%s_%s", channel->type, RATE);
        const fcsl_driver_status_t status = sysfs_put_text(setup->folder, attribute, setup->rate, why, size);
        if (status == FCSL_DRIVER_OK) {
            result = FCSL_DRIVER_OK;
        } else if (status != FCSL_DRIVER_NOTHING) {
            return status;
        }
    }
    return result;
}

static fcsl_driver_status_t require_rate(fcsl_driver_status_t status, char *why, size_t size)
{
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "the device has no %s, so its rate cannot be set", RATE);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

/* ---- trigger ------------------------------------------------------------------------------------------------------------ */

/* ABSENT is without a reason. */
static fcsl_driver_status_t find_called(const char *name, char *path, char *why, size_t size)
{
    const fcsl_driver_status_t status = sysfs_find(&triggers, name, path, why, size);
    if (status == FCSL_DRIVER_ABSENT) {
        (void)snprintf(why, size, "%s", "");
    }
    return status;
}

/* Drivers of the kernel call the data-ready trigger of their device NAME-devN, or NAME-trigger. */
static fcsl_driver_status_t find_own(const iio_setup_t *setup, char *path, char *why, size_t size)
{
    char device[SYSFS_TEXT_BYTES];
    char name[TRIGGER_BYTES];
    fcsl_driver_status_t status = sysfs_get_text(setup->folder, "name", device, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status == FCSL_DRIVER_NOTHING ? FCSL_DRIVER_ABSENT : status;
    }
    (void)snprintf(name, sizeof name, "%s-dev%" PRIu32, device, setup->number);
    status = find_called(name, path, why, size);
    if (status != FCSL_DRIVER_ABSENT) {
        return status;
    }
    (void)snprintf(name, sizeof name, "%s-trigger", device);
    return find_called(name, path, why, size);
}

static fcsl_driver_status_t make_timer(const iio_setup_t *setup, char *path, char *why, size_t size)
{
    char name[TRIGGER_BYTES];
    char types[SYSFS_PATH_BYTES];
    char timer[SYSFS_PATH_BYTES];
    (void)snprintf(name, sizeof name, "fcsl-%" PRIu32, setup->number);
    const int joined =
        sysfs_join(types, sysfs_root("FCSL_CONFIGFS", "/sys/kernel/config"), "iio/triggers/hrtimer") == 0 &&
        sysfs_join(timer, types, name) == 0;
    if (!joined || (mkdir(timer, TIMER_MODE) != 0 && errno != EEXIST)) {
        (void)snprintf(why, size, "cannot make a timer trigger in '%s': %s (kernel module iio-trig-hrtimer, configfs)",
                       types, strerror(errno));
        return FCSL_DRIVER_FAILED;
    }
    return sysfs_find(&triggers, name, path, why, size);
}

static fcsl_driver_status_t find_trigger(const iio_setup_t *setup, char *path, char *why, size_t size)
{
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    if (setup->trigger[0] != '\0') {
        status = sysfs_find(&triggers, setup->trigger, path, why, size);
    } else {
        status = find_own(setup, path, why, size);
        if (status == FCSL_DRIVER_ABSENT) {
            status = make_timer(setup, path, why, size);
        }
    }
    return status == FCSL_DRIVER_ABSENT ? FCSL_DRIVER_FAILED : status; /* the device is there */
}

static fcsl_driver_status_t attach(const iio_setup_t *setup, const char *path, char *why, size_t size)
{
    char name[SYSFS_TEXT_BYTES];
    fcsl_driver_status_t status = sysfs_get_text(path, "name", name, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = sysfs_put_text(setup->folder, CURRENT_TRIGGER, name, why, size);
    }
    if (status == FCSL_DRIVER_NOTHING) {
        (void)snprintf(why, size, "'%s' is no IIO trigger", path);
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

static fcsl_driver_status_t set_without_trigger(const iio_setup_t *setup, char *why, size_t size)
{
    if (setup->trigger[0] != '\0') {
        (void)snprintf(why, size, "the device takes no trigger");
        return FCSL_DRIVER_FAILED;
    }
    return require_rate(set_device_rate(setup, why, size), why, size);
}

fcsl_driver_status_t iio_set_trigger(const iio_setup_t *setup, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    struct stat found;
    if (sysfs_join(path, setup->folder, CURRENT_TRIGGER) != 0 || stat(path, &found) != 0) {
        return set_without_trigger(setup, why, size);
    }
    fcsl_driver_status_t status = find_trigger(setup, path, why, size);
    if (status == FCSL_DRIVER_OK) {
        status = attach(setup, path, why, size);
    }
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    status = sysfs_put_text(path, RATE, setup->rate, why, size);
    if (status == FCSL_DRIVER_NOTHING) {
        status = set_device_rate(setup, why, size);
    }
    if (status == FCSL_DRIVER_NOTHING && setup->trigger[0] != '\0') {
        return FCSL_DRIVER_OK; /* who names a trigger without a rate knows how often it comes */
    }
    return require_rate(status, why, size);
}
