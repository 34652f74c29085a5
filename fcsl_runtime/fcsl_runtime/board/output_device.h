/* SPDX-License-Identifier: Apache-2.0
 *
 * The device of outputs and its thread, which writes what the loop hands over. The loop never waits for it.
 */
#ifndef BOARD_OUTPUT_DEVICE_H
#define BOARD_OUTPUT_DEVICE_H

#include "fcsl/fcsl_driver.h"
#include "fcsl/fcsl_run.h"

enum { OUTPUT_REASON_BYTES = 160 };

typedef struct output_device output_device_t;

/* Finds the driver by its name as a user writes it: NAME or LIBRARY.so:NAME. `address` is the device's name for the driver. Null
 * with `error`. */
output_device_t *output_device_new(const char *driver, const char *address, fcsl_error_t *error);
const char *output_device_driver_name(const output_device_t *device);
const char *output_device_address(const output_device_t *device);
const fcsl_driver_t *output_device_driver(const output_device_t *device);
/* Before it is started: the signal of this index is driven. 0, or -1: it is driven already. */
int output_device_use(output_device_t *device, uint32_t signal);

/* Probes and opens the device, and starts its thread with this priority of SCHED_FIFO (0: as any thread). A write that lasts for longer
 * than `timeout_ns` is missed. 0, or -1: it is not open, and for output_device_free alone. */
int output_device_start(output_device_t *device, int priority, uint64_t timeout_ns, fcsl_error_t *error);
int output_device_is_open(const output_device_t *device);

/* From the loop. The place of the next values, laid out as the driver's struct: all driven signals are to be filled in. */
void *output_device_values(output_device_t *device);
/* Hands them over, and looks after the write that still lasts. */
void output_device_put(output_device_t *device, uint64_t now_ns);
/* Whether the last values handed over have not been written yet, with success or not. */
int output_device_is_busy(const output_device_t *device);
/* Awaits the last values handed over. */
void output_device_await(output_device_t *device);
/* Whether the device has taken those that are awaited, or later ones. */
int output_device_has_taken(const output_device_t *device);
/* Writes that failed, and periods in which one lasted for too long. */
uint64_t output_device_missed(const output_device_t *device);
/* Why the last one was missed; "" when the driver gives no reason. */
const char *output_device_reason(output_device_t *device);

/* Tells the thread to end when it has written what was handed over. */
void output_device_end(output_device_t *device);
/* Waits for its end until then, closes the device and frees it. One whose write does not end is left as it is, with its
 * memory. */
void output_device_free(output_device_t *device, uint64_t until_ns);

#endif /* BOARD_OUTPUT_DEVICE_H */
