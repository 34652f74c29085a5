/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds a driver by the name that a user gives, and checks its descriptor before a host trusts it.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_library.h"
#include "fcsl/fcsl_scalar.h"

enum { DRIVERS_MAX = 256, SIGNALS_MAX = 256, STATE_BYTES_MAX = 1 << 20, ALIGN_MAX = 4096 };
enum { PATH_BYTES = 4096, LIST_BYTES = 200 };

static const char *const DIRECTIONS[] = {"sensor", "actuator"};

/* A library's name ends in .so or holds a slash: no driver's does. */
size_t fcsl_library_driver_name(const char *name)
{
    const char *colon = strchr(name, ':');
    if (colon == NULL) {
        return 0;
    }
    const size_t length = (size_t)(colon - name);
    const int is_library = memchr(name, '/', length) != NULL || (length > 3u && strncmp(colon - 3, ".so", 3) == 0);
    return is_library ? length + 1u : 0u;
}

static int is_signal(const fcsl_driver_t *driver, const fcsl_driver_signal_t *signal)
{
    const uint32_t scalar = signal->type <= FCSL_F64 ? fcsl_scalar_size(signal->type) : 0u;
    return signal->name != NULL && signal->name[0] != '\0' && signal->unit != NULL && signal->doc != NULL &&
           scalar != 0u && signal->count > 0u && signal->offset % scalar == 0u &&
           signal->offset <= driver->state_size && signal->count <= (driver->state_size - signal->offset) / scalar;
}

/* What is wrong with a driver's descriptor, or null. */
static const char *flaw(const fcsl_driver_t *driver)
{
    if (driver->doc == NULL || driver->direction > FCSL_ACTUATOR || driver->probe == NULL || driver->open == NULL ||
        driver->close == NULL) {
        return "it lacks doc, direction, probe, open or close";
    }
    if ((driver->read != NULL) != (driver->direction == FCSL_SENSOR) ||
        (driver->write != NULL) != (driver->direction == FCSL_ACTUATOR)) {
        return "a sensor has read and no write, an actuator write and no read";
    }
    if (driver->input != 0u &&
        (driver->input % _Alignof(fcsl_driver_input_t) != 0u || driver->input > driver->state_size ||
         driver->state_size - driver->input < sizeof(fcsl_driver_input_t))) {
        return "its input lies outside the state";
    }
    const uint32_t align = driver->state_align;
    if (driver->state_size == 0u || driver->state_size > STATE_BYTES_MAX || align == 0u || align > ALIGN_MAX ||
        (align & (align - 1u)) != 0u) {
        return "its state_size or state_align is impossible";
    }
    if (driver->signals == NULL || driver->signal_count == 0u || driver->signal_count > SIGNALS_MAX) {
        return "it has no signals, or too many";
    }
    for (uint32_t i = 0; i < driver->signal_count; i++) {
        if (!is_signal(driver, &driver->signals[i])) {
            return "a signal lacks its name, unit, doc or type, or lies outside the state";
        }
        for (uint32_t j = 0; j < i; j++) {
            if (strcmp(driver->signals[i].name, driver->signals[j].name) == 0) {
                return "two signals have one name";
            }
        }
    }
    return NULL;
}

/* A library's drivers with their directions. Those that come with FCSL are many: of them the names for one direction. */
static void list_drivers(const fcsl_driver_t *const *drivers, const char *where, fcsl_direction_t direction, char *text,
                         size_t size)
{
    size_t at = 0;
    (void)snprintf(text, size, "none");
    for (uint32_t i = 0; i < DRIVERS_MAX && drivers[i] != NULL && at < size; i++) {
        const fcsl_driver_t *driver = drivers[i];
        const int listed = where != NULL ? driver->direction <= FCSL_ACTUATOR : driver->direction == (uint8_t)direction;
        if (driver->name != NULL && listed) {
            const char *comma = at > 0u ? ", " : "";
            const int length = where != NULL ? snprintf(text + at, size - at, "%s%s (%s)", comma, driver->name,
                                                        DIRECTIONS[driver->direction])
                                             : snprintf(text + at, size - at, "%s%s", comma, driver->name);
            at += length > 0 ? (size_t)length : 0u;
        }
    }
}

/* `where`: the library, or null. */
static const fcsl_driver_t *choose(const fcsl_driver_t *const *drivers, const char *where, const char *name,
                                   fcsl_direction_t direction, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < DRIVERS_MAX && drivers[i] != NULL; i++) {
        const fcsl_driver_t *driver = drivers[i];
        /* Of another ABI nothing but this number is known. */
        if (driver->abi_version != FCSL_DRIVER_ABI_VERSION) {
            (void)fcsl_fail(error, "%.300s: driver ABI %u, this program has %u: compile the drivers again",
                            where != NULL ? where : "built in", driver->abi_version, FCSL_DRIVER_ABI_VERSION);
            return NULL;
        }
        if (driver->name == NULL || strcmp(driver->name, name) != 0) {
            continue;
        }
        const char *reason = flaw(driver);
        if (reason != NULL) {
            (void)fcsl_fail(error, "driver '%s': %s", name, reason);
            return NULL;
        }
        if (driver->direction != (uint8_t)direction) {
            (void)fcsl_fail(error, "driver '%s' is for %ss, not for %ss", name, DIRECTIONS[driver->direction],
                            DIRECTIONS[direction]);
            return NULL;
        }
        return driver;
    }
    char names[LIST_BYTES];
    list_drivers(drivers, where, direction, names, sizeof names);
    if (where != NULL) {
        (void)fcsl_fail(error, "'%.200s' holds no driver '%.60s'; it holds: %s", where, name, names);
    } else {
        (void)fcsl_fail(error, "FCSL has no driver '%.60s' for %ss; it has: %s. One of a library is LIBRARY.so:NAME",
                        name, DIRECTIONS[direction], names);
    }
    return NULL;
}

const fcsl_driver_t *fcsl_library_driver(const char *name, fcsl_direction_t direction, void **handle,
                                         fcsl_error_t *error)
{
    *handle = NULL;
    const size_t begin = fcsl_library_driver_name(name);
    if (begin == 0u) {
        return choose(fcsl_drivers_built_in, NULL, name, direction, error);
    }
    char library[PATH_BYTES];
    if (begin > sizeof library) {
        (void)fcsl_fail(error, "the path of the driver library is too long");
        return NULL;
    }
    (void)snprintf(library, begin, "%s", name);
    *handle = fcsl_library_open(library, "driver", error);
    if (*handle == NULL) {
        return NULL;
    }
    const fcsl_driver_t *const *drivers = (const fcsl_driver_t *const *)dlsym(*handle, "fcsl_drivers");
    const fcsl_driver_t *driver = NULL;
    if (drivers == NULL) {
        (void)fcsl_fail(error, "'%.400s' is not a driver library: it has no symbol fcsl_drivers", library);
    } else {
        driver = choose(drivers, library, name + begin, direction, error);
    }
    if (driver == NULL) {
        (void)dlclose(*handle);
        *handle = NULL;
    }
    return driver;
}
