/* SPDX-License-Identifier: Apache-2.0
 *
 * The devices of a plan that are read, and which sensor each of their samples is a reading of.
 */
#ifndef BOARD_BOARD_DEVICES_H
#define BOARD_BOARD_DEVICES_H

#include "sensor_device.h"

/* A reading of the backend of a sensor. */
typedef struct {
    uint32_t sensor; /* index into the plan's */
    fcsl_reading_t reading;
} sensor_reading_t;

typedef struct board_devices board_devices_t;

/* Finds drivers and signals; opens nothing. Quantities that the machine gets must have a signal. `plan` must outlive it. Null with
 * `error`. */
board_devices_t *board_devices_new(const board_plan_t *plan, fcsl_error_t *error);
/* Before the start: what hw_read_… of a pin or a converter needs. Returns where the signal, which must be a scalar, lies among the latest
 * values of the device of the plan, or -1 with `error`. */
int board_devices_use(board_devices_t *devices, uint32_t device, const char *signal, fcsl_error_t *error);
/* Opens all devices and starts their threads, with this priority of SCHED_FIFO (0: as any thread). 0, or -1. */
int board_devices_start(board_devices_t *devices, int priority, fcsl_error_t *error);
/* Where a device paces the loop: waits for its next sample until `deadline_ns` of the monotonic clock, or until it is interrupted: 1, 0
 * when there is none, or -1. */
int board_devices_wait(board_devices_t *devices, uint64_t deadline_ns);
/* From any thread: a wait ends, and so do all later ones. */
void board_devices_interrupt(board_devices_t *devices);
/* From one thread: takes what the devices have given since the last call, device by device, into `readings`; one sample of the device that
 * paces the loop. At most `capacity` readings, of which each device has its share: of one that gave more the oldest samples are dropped.
 * Returns how many. Does not wait. */
uint32_t board_devices_take(board_devices_t *devices, sensor_reading_t *readings, uint32_t capacity);
/* The newest sample of a device as of the last board_devices_take. Null: there is none, its last read failed, or it is old: of a device
 * with a rate three periods, and half a second at least. */
const device_sample_t *board_devices_latest(const board_devices_t *devices, uint32_t device);
/* Throws away what the devices have given, but the newest sample of each. */
void board_devices_discard(board_devices_t *devices);
/* Of a device of the plan. */
device_counts_t board_devices_counts(const board_devices_t *devices, uint32_t device);
/* Of any device, since the last call: a text for people, or null when nothing has changed. */
const char *board_devices_news(board_devices_t *devices);
/* Ends the threads. 0, or -1: one hangs in its driver, and all memory stays, that of the plan must, too. */
int board_devices_free(board_devices_t *devices);

#endif /* BOARD_BOARD_DEVICES_H */
