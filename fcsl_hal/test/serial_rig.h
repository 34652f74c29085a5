/* SPDX-License-Identifier: Apache-2.0
 *
 * A serial device for tests: a pseudo terminal, whose master plays the device. With what holds of every serial driver.
 */
#ifndef FCSL_SERIAL_RIG_H
#define FCSL_SERIAL_RIG_H

#include <asm/termbits.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "driver_rig.h"

enum { SERIAL_NAME_BYTES = 64 };

typedef struct {
    int master;
    char name[SERIAL_NAME_BYTES];
} serial_rig_t;

static inline serial_rig_t serial_rig_open(void)
{
    serial_rig_t line = {.master = posix_openpt(O_RDWR | O_NOCTTY)};
    CHECK(line.master >= 0 && grantpt(line.master) == 0 && unlockpt(line.master) == 0);
    CHECK(ptsname_r(line.master, line.name, sizeof line.name) == 0);
    return line;
}

static inline void serial_rig_send(const serial_rig_t *line, const void *bytes, size_t size)
{
    CHECK(write(line->master, bytes, size) == (ssize_t)size);
}

/* ---- in two parts ------------------------------------------------------------------------------------------------------- */

typedef struct {
    const serial_rig_t *line;
    const uint8_t *bytes;
    size_t size;
    size_t first; /* bytes of the first part */
    atomic_int sent; /* the second part, too */
} serial_parts_t;

static inline void *serial_rig_send_parts(void *argument)
{
    serial_parts_t *parts = argument;
    serial_rig_send(parts->line, parts->bytes, parts->first);
    fcsl_monotonic_wait(fcsl_monotonic_ns() + 500000u);
    serial_rig_send(parts->line, parts->bytes + parts->first, parts->size - parts->first);
    atomic_store(&parts->sent, 1);
    return NULL;
}

/* Reads while the bytes come in two parts. On a busy computer the sender may be late, and reads give nothing until then. */
static inline fcsl_driver_status_t serial_rig_read_parts(rig_t *rig, serial_parts_t parts)
{
    pthread_t sender;
    CHECK(pthread_create(&sender, NULL, serial_rig_send_parts, &parts) == 0);
    fcsl_driver_status_t status = rig_read(rig);
    while (status == FCSL_DRIVER_NOTHING && atomic_load(&parts.sent) == 0) {
        status = rig_read(rig);
    }
    CHECK(pthread_join(sender, NULL) == 0);
    return status == FCSL_DRIVER_NOTHING ? rig_read(rig) : status;
}

/* ---- bytes without end -------------------------------------------------------------------------------------------------- */

typedef struct {
    int master;
    atomic_int stop;
} serial_flood_t;

static inline void *serial_rig_flood(void *argument)
{
    static const uint8_t GARBAGE[] = {0xFF, 0x55, 0xAA, 0x7E, 0xFF, 0x33, 0x99, 0x66};
    serial_flood_t *flood = argument;
    while (atomic_load(&flood->stop) == 0) {
        (void)!write(flood->master, GARBAGE, sizeof GARBAGE);
    }
    return NULL;
}

/* Whether a device that never stops sending garbage gives NOTHING, as a silent one does. */
static inline int serial_rig_survives_flood(rig_t *rig, const serial_rig_t *line)
{
    pthread_t sender;
    serial_flood_t flood = {.master = line->master};
    CHECK(fcntl(line->master, F_SETFL, O_RDWR | O_NONBLOCK) == 0);
    CHECK(pthread_create(&sender, NULL, serial_rig_flood, &flood) == 0);
    const int survives = rig_is_silent(rig);
    atomic_store(&flood.stop, 1);
    CHECK(pthread_join(sender, NULL) == 0 && fcntl(line->master, F_SETFL, O_RDWR) == 0);
    return survives;
}

/* ---- what holds of every serial driver ---------------------------------------------------------------------------------- */

/* The mode that the driver has set. */
static inline struct termios2 serial_rig_mode(const serial_rig_t *line)
{
    struct termios2 mode;
    CHECK(ioctl(line->master, TCGETS2, &mode) == 0);
    return mode;
}

static inline void serial_rig_check_names(const fcsl_driver_t *driver)
{
    static rig_t rig;
    char device[SERIAL_NAME_BYTES + 16];
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_probes(driver, line.name, FCSL_DRIVER_OK, ""));
    CHECK(rig_probes(driver, "", FCSL_DRIVER_ABSENT, "name the serial device"));
    CHECK(rig_probes(driver, "/dev/ttyNone", FCSL_DRIVER_ABSENT, "No such file"));
    CHECK(rig_probes(driver, "/dev/ttyNone:9600", FCSL_DRIVER_ABSENT, "'/dev/ttyNone': No such file"));
    CHECK(rig_probes(driver, "/dev/by-path/pci-0:00:1.0-port0", FCSL_DRIVER_ABSENT, "port0': No such file"));
    CHECK(rig_probes(driver, "/etc/passwd", FCSL_DRIVER_FAILED, "no serial device"));
    static const char *const WRONG[] = {"fast", "", "0", "-9600", "9600x", "999999999", "96 00"};
    for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++) {
        (void)snprintf(device, sizeof device, "%s:%s", line.name, WRONG[i]);
        CHECK(rig_probes(driver, device, FCSL_DRIVER_FAILED, "is no baud rate"));
        CHECK(rig_open(&rig, driver, device) == FCSL_DRIVER_FAILED && strstr(rig.why, "is no baud rate") != NULL);
    }
    CHECK(rig_open(&rig, driver, "/dev/ttyNone") == FCSL_DRIVER_ABSENT);
    CHECK(rig_open(&rig, driver, "/dev/null") == FCSL_DRIVER_FAILED && strstr(rig.why, "no serial device") != NULL);
    (void)snprintf(device, sizeof device, "%s:123457", line.name);
    CHECK(rig_open(&rig, driver, device) == FCSL_DRIVER_OK);
    CHECK(serial_rig_mode(&line).c_ospeed == 123457u);
    rig_close(&rig);
    (void)close(line.master);
}

static inline void serial_rig_check_life(const fcsl_driver_t *driver)
{
    static rig_t rig;
    static rig_t other;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, driver, line.name) == FCSL_DRIVER_OK);
    CHECK(rig_open(&other, driver, line.name) == FCSL_DRIVER_FAILED && strstr(other.why, "in use") != NULL);
    CHECK(rig_is_silent(&rig));
    CHECK(serial_rig_survives_flood(&rig, &line));
    (void)close(line.master);
    for (int i = 0; i < 3; i++) { /* garbage that was left may come first */
        if (rig_read(&rig) == FCSL_DRIVER_ABSENT) {
            CHECK(strstr(rig.why, "unplugged") != NULL);
            rig_close(&rig);
            return;
        }
    }
    CHECK(!"an unplugged device is absent");
}

#endif /* FCSL_SERIAL_RIG_H */
