/* SPDX-License-Identifier: Apache-2.0
 *
 * Looks through the input devices in sysfs. Their names may have slashes (phys always does), so only what begins with one is a path.
 */
#define _GNU_SOURCE
#include "evdev_find.h"

#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "sysfs/sysfs.h"

/* The number of `event<number>`; 0, or -1. */
static int event_number(const char *name, uint32_t *number)
{
    char more = '\0';
    return sscanf(name, "event%" SCNu32 "%c", number, &more) == 1 ? 0 : -1;
}

static int attribute_is(const char *folder, const char *attribute, const char *text)
{
    char found[SYSFS_TEXT_BYTES];
    char why[1];
    return sysfs_get_text(folder, attribute, found, why, sizeof why) == FCSL_DRIVER_OK && strcmp(found, text) == 0;
}

static int is_called(const char *folder, const char *event, const char *text)
{
    char path[SYSFS_PATH_BYTES];
    return sysfs_join(path, folder, event) == 0 &&
           (attribute_is(path, "device/name", text) || attribute_is(path, "device/uniq", text) ||
            attribute_is(path, "device/phys", text));
}

/* How many input devices are called so; *number is that of the last one. */
static uint32_t count_called(const char *folder, const char *text, uint32_t *number)
{
    uint32_t found = 0;
    DIR *events = opendir(folder);
    if (events == NULL) {
        return 0;
    }
    for (uint32_t i = 0; i < SYSFS_ENTRIES_MAX; i++) {
        const struct dirent *entry = readdir(events);
        if (entry == NULL) {
            break;
        }
        uint32_t event = 0;
        if (event_number(entry->d_name, &event) == 0 && is_called(folder, entry->d_name, text)) {
            *number = event;
            found++;
        }
    }
    (void)closedir(events);
    return found;
}

/* The path of the only input device that is called so. */
static fcsl_driver_status_t find_called(const char *device, char path[EVDEV_PATH_BYTES], char *why, size_t size)
{
    char folder[SYSFS_PATH_BYTES] = "";
    uint32_t number = 0;
    const int joined = sysfs_join(folder, sysfs_root("FCSL_SYSFS", "/sys"), "class/input") == 0;
    const uint32_t found = joined ? count_called(folder, device, &number) : 0u;
    if (found == 0u) {
        (void)snprintf(why, size, "no input device is called '%s'; see %s/event*/device/name", device, folder);
        return FCSL_DRIVER_ABSENT;
    }
    if (found > 1u) {
        (void)snprintf(why, size, "%" PRIu32 " input devices are called '%s'; name the file of one", found, device);
        return FCSL_DRIVER_FAILED;
    }
    const int length =
        snprintf(path, EVDEV_PATH_BYTES, "%s/input/event%" PRIu32, sysfs_root("FCSL_DEV", "/dev"), number);
    if (length >= EVDEV_PATH_BYTES) {
        (void)snprintf(why, size, "the path of '%s' is too long", device);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

fcsl_driver_status_t evdev_find(const char *device, char path[EVDEV_PATH_BYTES], char *why, size_t size)
{
    if (device[0] == '\0') {
        (void)snprintf(why, size, "name the input device: /dev/input/eventN, or its name in /sys/class/input");
        return FCSL_DRIVER_ABSENT;
    }
    if (device[0] != '/') {
        return find_called(device, path, why, size);
    }
    if (snprintf(path, EVDEV_PATH_BYTES, "%s", device) >= EVDEV_PATH_BYTES) {
        (void)snprintf(why, size, "the path of the input device is too long");
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}
