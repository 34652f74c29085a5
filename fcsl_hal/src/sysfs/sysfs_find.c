/* SPDX-License-Identifier: Apache-2.0
 *
 * The folder of a device of sysfs. The numbers in the names of folders change from boot to boot; the texts of attributes stay, and so
 * does the place of a chip on its bus, by which two chips of one kind differ.
 */
#define _GNU_SOURCE
#include "sysfs.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static fcsl_driver_status_t find_by_path(const sysfs_class_t *devices, const char *device, char *path, char *why,
                                         size_t size)
{
    struct stat status;
    if (strlen(device) >= SYSFS_PATH_BYTES) {
        (void)snprintf(why, size, "the path of the %s is too long", devices->noun);
        return FCSL_DRIVER_FAILED;
    }
    if (stat(device, &status) != 0) {
        const int code = errno;
        (void)snprintf(why, size, "no %s is at '%s': %s", devices->noun, device, strerror(code));
        return code == ENOENT || code == ENOTDIR ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
    }
    if (!S_ISDIR(status.st_mode)) {
        (void)snprintf(why, size, "'%s' is no folder, so no %s", device, devices->noun);
        return FCSL_DRIVER_FAILED;
    }
    memcpy(path, device, strlen(device) + 1u);
    return FCSL_DRIVER_OK;
}

/* The next device, or null after the last one. `entries` bounds a folder that never ends. */
static const char *next_device(const sysfs_class_t *devices, DIR *folder, uint32_t *entries)
{
    while (*entries < SYSFS_ENTRIES_MAX) {
        const struct dirent *entry = readdir(folder);
        if (entry == NULL) {
            return NULL;
        }
        (*entries)++;
        if (entry->d_name[0] != '.' && strncmp(entry->d_name, devices->prefix, strlen(devices->prefix)) == 0) {
            return entry->d_name;
        }
    }
    return NULL;
}

static int belongs_to(const sysfs_class_t *devices, const char *path, const char *device)
{
    char link[SYSFS_PATH_BYTES];
    char owner[PATH_MAX];
    if (devices->owner == NULL || sysfs_join(link, path, devices->owner) != 0 || realpath(link, owner) == NULL) {
        return 0;
    }
    const char *name = strrchr(owner, '/');
    return name != NULL && strcmp(name + 1, device) == 0;
}

static int is_called(const sysfs_class_t *devices, const char *path, const char *entry, const char *device)
{
    char text[SYSFS_TEXT_BYTES];
    char why[1];
    if (strcmp(entry, device) == 0 || belongs_to(devices, path, device)) {
        return 1;
    }
    for (const char *const *name = devices->names; *name != NULL; name++) {
        if (sysfs_get_text(path, *name, text, why, sizeof why) == FCSL_DRIVER_OK && strcmp(text, device) == 0) {
            return 1;
        }
    }
    return 0;
}

static void append(char *why, size_t size, const char *before, const char *text)
{
    const size_t length = strnlen(why, size);
    (void)snprintf(why + length, size - length, "%s%s", before, text);
}

/* The devices that are there, each by the first of its names. */
static void list_names(const sysfs_class_t *devices, const char *root, DIR *folder, char *why, size_t size)
{
    char path[SYSFS_PATH_BYTES];
    char text[SYSFS_TEXT_BYTES];
    char ignored[1];
    const char *before = "; there are: ";
    uint32_t entries = 0;
    const char *entry = next_device(devices, folder, &entries);
    while (entry != NULL) {
        const int named = devices->names[0] != NULL && sysfs_join(path, root, entry) == 0 &&
                          sysfs_get_text(path, devices->names[0], text, ignored, sizeof ignored) == FCSL_DRIVER_OK;
        append(why, size, before, named ? text : entry);
        before = ", ";
        entry = next_device(devices, folder, &entries);
    }
    if (before[0] == ';') {
        append(why, size, "; there is none", "");
    }
}

/* Finds it in the open folder `root`. */
static fcsl_driver_status_t find_in(const sysfs_class_t *devices, const char *device, const char *root, DIR *folder,
                                    char *path, char *why, size_t size)
{
    char other[SYSFS_PATH_BYTES];
    uint32_t entries = 0;
    uint32_t found = 0;
    const char *entry = next_device(devices, folder, &entries);
    while (entry != NULL && found < 2u) {
        char *place = found == 0u ? path : other;
        found += sysfs_join(place, root, entry) == 0 && is_called(devices, place, entry, device);
        entry = next_device(devices, folder, &entries);
    }
    if (found == 2u) {
        const int by_name = devices->owner != NULL && !belongs_to(devices, path, device);
        (void)snprintf(why, size, "'%s' names more than one %s, %s and %s; name it by its path%s", device,
                       devices->noun, path, other, by_name ? ", or its place on the bus: 1-0068" : "");
        return FCSL_DRIVER_FAILED;
    }
    if (found == 0u) {
        (void)snprintf(why, size, "no %s is called '%s'", devices->noun, device);
        rewinddir(folder);
        list_names(devices, root, folder, why, size);
        return FCSL_DRIVER_ABSENT;
    }
    return FCSL_DRIVER_OK;
}

fcsl_driver_status_t sysfs_find(const sysfs_class_t *devices, const char *device, char *path, char *why, size_t size)
{
    if (strchr(device, '/') != NULL) {
        return find_by_path(devices, device, path, why, size);
    }
    char root[SYSFS_PATH_BYTES];
    DIR *folder = NULL;
    if (sysfs_join(root, sysfs_root("FCSL_SYSFS", "/sys"), devices->folder) == 0) {
        folder = opendir(root);
    }
    if (folder == NULL) {
        const int code = errno;
        (void)snprintf(why, size, "no %s is called '%s'; '%s': %s", devices->noun, device, root, strerror(code));
        return code == ENOENT ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
    }
    const fcsl_driver_status_t status = find_in(devices, device, root, folder, path, why, size);
    (void)closedir(folder);
    return status;
}
