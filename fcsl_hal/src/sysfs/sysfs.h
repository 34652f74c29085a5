/* SPDX-License-Identifier: Apache-2.0
 *
 * Devices that the kernel shows as folders of sysfs, and their attributes: files of one line. sysfs is at /sys, or where the
 * environment's FCSL_SYSFS says.
 */
#ifndef FCSL_SYSFS_H
#define FCSL_SYSFS_H

#include "fcsl/fcsl_driver.h"

enum {
    SYSFS_PATH_BYTES = 512,
    SYSFS_TEXT_BYTES = 128, /* of an attribute, with its zero */
    SYSFS_ENTRIES_MAX = 1024 /* of a folder that is searched */
};

/* Devices of one kind: folders in one folder. */
typedef struct {
    const char *noun; /* "IIO device" */
    const char *folder; /* "bus/iio/devices", below the root */
    const char *prefix; /* "iio:device": how the names of their folders begin */
    const char *const *names; /* attributes whose text names a device; ends with a null pointer */
    const char *owner; /* "..": leads from a folder to that of what it belongs to, whose name also names it; or null */
} sysfs_class_t;

/* The environment's variable, or `otherwise`. */
const char *sysfs_root(const char *variable, const char *otherwise);

/* Joins them with a slash into SYSFS_PATH_BYTES. 0, or -1 with errno. */
int sysfs_join(char *path, const char *folder, const char *name);

/* Finds the folder of a device by its path, the name of its folder or of its owner's, or the text of an attribute. It is ABSENT, with
 * the names of those that are there; or FAILED where two devices have the name. */
fcsl_driver_status_t sysfs_find(const sysfs_class_t *devices, const char *device, char *path, char *why, size_t size);

/* Opens an attribute for reading. NOTHING, without a reason: the folder has no such attribute. */
fcsl_driver_status_t sysfs_open(const char *folder, const char *attribute, int *file, char *why, size_t size);

/* Reads an open attribute; `name` is for the reason. ABSENT: the device has gone. NOTHING: the kernel has no value yet. */
fcsl_driver_status_t sysfs_read_text(int file, const char *name, char *text, char *why, size_t size);
fcsl_driver_status_t sysfs_read_number(int file, const char *name, double *number, char *why, size_t size);

/* The same for an attribute that is read once. NOTHING, without a reason: the folder has no such attribute. */
fcsl_driver_status_t sysfs_get_text(const char *folder, const char *attribute, char *text, char *why, size_t size);
fcsl_driver_status_t sysfs_get_number(const char *folder, const char *attribute, double *number, char *why,
                                      size_t size);

/* Writes an attribute. NOTHING, without a reason: the folder has no such attribute. */
fcsl_driver_status_t sysfs_put_text(const char *folder, const char *attribute, const char *text, char *why,
                                    size_t size);

/* 0, or -1: the text is no decimal number of at most 1e30. */
int sysfs_parse_number(const char *text, double *number);

#endif /* FCSL_SYSFS_H */
