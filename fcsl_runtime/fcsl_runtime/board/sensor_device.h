/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor's device, read through its driver by a thread of its own. What it measures waits in a bounded ring for the step thread, which
 * never waits for the device. A device that is missing, or goes, is looked for again and again.
 */
#ifndef BOARD_SENSOR_DEVICE_H
#define BOARD_SENSOR_DEVICE_H

#include <semaphore.h>

#include "board_plan.h"
#include "fcsl/fcsl_driver.h"

enum { DEVICE_VALUES_MAX = 64, DEVICE_REASON_BYTES = 160, DEVICE_RING_SAMPLES = 256 };

/* What a device gave at one time: the used signals one after the other, as doubles. */
typedef struct {
    uint64_t sample_ns; /* monotonic */
    double values[DEVICE_VALUES_MAX];
} device_sample_t;

typedef struct {
    uint64_t samples;
    uint64_t errors; /* reads that failed */
    uint64_t dropped; /* samples that no tick took: newer ones came */
    uint64_t lost; /* how often the device was gone */
    uint64_t open; /* 1: it is there */
    uint64_t bytes; /* that arrived; 0 where the driver does not tell, as of the next ones */
    uint64_t frames;
    uint64_t rejected; /* bytes that belong to no frame */
    uint64_t why; /* fcsl_driver_why_t: why it is silent */
} device_counts_t;

typedef struct sensor_device sensor_device_t;

/* Finds the driver. Nothing is opened. Null with `error`. `plan` must outlive the device. */
sensor_device_t *sensor_device_new(const board_device_t *plan, fcsl_error_t *error);
/* Says how this signal is used; `count` of its elements at most. Returns where its first element lies in the samples, or -1 with
 * `error`: no such signal, another unit, or too many. *found: how many elements there are. */
int sensor_device_use(sensor_device_t *device, const char *signal, const char *unit, fcsl_driver_use_t use,
                      uint32_t count, uint32_t *found, fcsl_error_t *error);
/* Each sample that it keeps posts the semaphore. Before start. */
void sensor_device_post(sensor_device_t *device, sem_t *semaphore);
/* Opens the device and starts its thread with this priority of SCHED_FIFO (0: as any thread). A device that is not there is no error. */
int sensor_device_start(sensor_device_t *device, int priority, fcsl_error_t *error);
/* From the step thread: the oldest sample that was not taken, 1; or 0. Does not wait. */
int sensor_device_take(sensor_device_t *device, device_sample_t *sample);
/* Drops the oldest samples until `most` are left at most, and counts them. */
void sensor_device_skip(sensor_device_t *device, uint32_t most);
/* Of a fcsl_driver_why_t, for people; "" for 0. */
const char *board_why_text(uint64_t why);
/* Whether the device is there, and its last read did not fail. */
int sensor_device_is_well(const sensor_device_t *device);
/* Whether one waits. */
int sensor_device_has_sample(const sensor_device_t *device);
device_counts_t sensor_device_counts(const sensor_device_t *device);
/* Whether the device came, went, fell silent or began to fail since the last text: a text for people, once a second at most; or null. */
const char *sensor_device_news(sensor_device_t *device);
/* Ends the thread and closes the device. 0, or -1: a driver that hangs was left alone after 1 s; plan and device stay in use. */
int sensor_device_free(sensor_device_t *device);

#endif /* BOARD_SENSOR_DEVICE_H */
