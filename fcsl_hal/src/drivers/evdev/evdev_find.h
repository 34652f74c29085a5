/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds the file of an input device.
 */
#ifndef FCSL_EVDEV_FIND_H
#define FCSL_EVDEV_FIND_H

#include "fcsl/fcsl_driver.h"

enum { EVDEV_PATH_BYTES = 256 };

/* `device` is a path, or the name, serial number (uniq) or place (phys) of one input device, as its
 * folder in /sys/class/input has it. The environment variables FCSL_SYSFS and FCSL_DEV replace /sys and /dev. */
fcsl_driver_status_t evdev_find(const char *device, char path[EVDEV_PATH_BYTES], char *why, size_t size);

#endif /* FCSL_EVDEV_FIND_H */
