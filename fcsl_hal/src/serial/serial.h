/* SPDX-License-Identifier: Apache-2.0
 *
 * Serial devices of drivers: a tty that is raw, at any rate, and for one process alone. A driver names its device
 * `DEVICE[:BAUD]`, for example `/dev/ttyUSB0:9600`.
 */
#ifndef FCSL_SERIAL_H
#define FCSL_SERIAL_H

#include "fcsl/fcsl_driver.h"

typedef struct {
    uint32_t baud;
    int even_parity; /* 0: none */
    int two_stop_bits; /* 0: one */
} serial_mode_t;

/* Whether the device of this text is there. Opens nothing. */
fcsl_driver_status_t serial_probe(const char *device, char *why, size_t size);

/* Opens it for reading. `mode` has the baud rate of a device that names none. */
fcsl_driver_status_t serial_open(const char *device, const serial_mode_t *mode, int *fd, char *why, size_t size);

/* Keeps all others out of an open tty. 0, or -1 with errno. */
int serial_take_for_us(int fd);

/* Makes an open tty raw and sets its mode. 0, or -1 with the reason. */
int serial_set_mode(int fd, const serial_mode_t *mode, char *why, size_t size);

/* Takes the bytes of one read, which came at `time_ns`. Returns 1 with a new sample in `self` and its time, else 0. */
typedef int (*serial_take_t)(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns);

/* The read function of a driver: reads until `take` has a sample, FCSL_DRIVER_WAIT_MS at most, and counts the bytes in *input. Bytes that are read together
 * have one time, so of several frames in them the last one is the sample. */
fcsl_driver_status_t serial_sample(int fd, serial_take_t take, void *self, fcsl_driver_input_t *input,
                                   uint64_t *sample_ns, char *why, size_t size);

#endif /* FCSL_SERIAL_H */
