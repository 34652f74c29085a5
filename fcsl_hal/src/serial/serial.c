/* SPDX-License-Identifier: Apache-2.0
 *
 * Finds, opens and reads serial devices.
 */
#define _GNU_SOURCE
#include "serial.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

enum { PATH_BYTES = 256, BAUD_DIGITS_MAX = 8, CHUNK_BYTES = 256 };

typedef struct {
    char path[PATH_BYTES];
    uint32_t baud; /* 0: not named */
} device_t;

/* ---- the device's text -------------------------------------------------------------------------------------------------- */

static int is_number(const char *text)
{
    const size_t digits = strspn(text, "0123456789");
    return digits > 0u && text[digits] == '\0';
}

/* Where the baud rate begins, or null. Paths below /dev/serial/by-path have colons, too. */
static const char *find_baud(const char *text)
{
    const char *colon = strrchr(text, ':');
    if (colon == NULL || access(text, F_OK) == 0) {
        return NULL;
    }
    char path[PATH_BYTES];
    (void)snprintf(path, sizeof path, "%.*s", (int)(colon - text), text);
    return is_number(colon + 1) || access(path, F_OK) == 0 ? colon + 1 : NULL;
}

static fcsl_driver_status_t parse(const char *text, device_t *device, char *why, size_t size)
{
    const size_t length = strlen(text);
    if (length == 0u) {
        (void)snprintf(why, size, "name the serial device: DEVICE[:BAUD]");
        return FCSL_DRIVER_ABSENT;
    }
    if (length >= PATH_BYTES) {
        (void)snprintf(why, size, "the name of the serial device is too long");
        return FCSL_DRIVER_FAILED;
    }
    const char *baud = find_baud(text);
    const size_t path_length = baud != NULL ? (size_t)(baud - text) - 1u : length;
    *device = (device_t){.baud = 0};
    memcpy(device->path, text, path_length);
    if (baud == NULL) {
        return FCSL_DRIVER_OK;
    }
    if (is_number(baud) && strlen(baud) <= BAUD_DIGITS_MAX) {
        device->baud = (uint32_t)strtoul(baud, NULL, 10);
    }
    if (device->baud == 0u) {
        (void)snprintf(why, size, "'%s' is no baud rate", baud);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

/* The status and the reason for an errno that the device gave. */
static fcsl_driver_status_t judge_error(int code, const char *path, char *why, size_t size)
{
    const char *hint = code == EACCES ? "; may this user read it (group dialout)?" : "";
    (void)snprintf(why, size, "cannot open '%s': %s%s", path, strerror(code), hint);
    const int absent = code == ENOENT || code == ENODEV || code == ENXIO;
    return absent ? FCSL_DRIVER_ABSENT : FCSL_DRIVER_FAILED;
}

fcsl_driver_status_t serial_probe(const char *text, char *why, size_t size)
{
    device_t device;
    struct stat found;
    const fcsl_driver_status_t status = parse(text, &device, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    if (stat(device.path, &found) != 0 || access(device.path, R_OK) != 0) {
        return judge_error(errno, device.path, why, size);
    }
    if (!S_ISCHR(found.st_mode)) {
        (void)snprintf(why, size, "'%s' is no serial device", device.path);
        return FCSL_DRIVER_FAILED;
    }
    return FCSL_DRIVER_OK;
}

/* ---- open --------------------------------------------------------------------------------------------------------------- */

/* TIOCEXCL keeps other users out, the lock those who are root, too, if they ask. */
int serial_take_for_us(int fd)
{
    return flock(fd, LOCK_EX | LOCK_NB) == 0 && ioctl(fd, TIOCEXCL) == 0 ? 0 : -1;
}

/* 0, or -1 with the reason. */
static int set_up(int fd, const char *path, const serial_mode_t *mode, char *why, size_t size)
{
    if (isatty(fd) == 0) {
        (void)snprintf(why, size, "'%s' is no serial device: %s", path, strerror(errno));
        return -1;
    }
    if (serial_take_for_us(fd) != 0) {
        (void)snprintf(why, size, "'%s' is in use by another process", path);
        return -1;
    }
    return serial_set_mode(fd, mode, why, size);
}

fcsl_driver_status_t serial_open(const char *text, const serial_mode_t *mode, int *fd, char *why, size_t size)
{
    device_t device;
    const fcsl_driver_status_t status = parse(text, &device, why, size);
    if (status != FCSL_DRIVER_OK) {
        return status;
    }
    /* O_NONBLOCK: opening does not wait for a carrier. */
    const int opened = open(device.path, O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (opened < 0) {
        return judge_error(errno, device.path, why, size);
    }
    serial_mode_t wanted = *mode;
    wanted.baud = device.baud != 0u ? device.baud : mode->baud;
    if (set_up(opened, device.path, &wanted, why, size) != 0) {
        (void)close(opened);
        return FCSL_DRIVER_FAILED;
    }
    *fd = opened;
    return FCSL_DRIVER_OK;
}

/* ---- read --------------------------------------------------------------------------------------------------------------- */

/* What came, or NOTHING at the deadline. */
static fcsl_driver_status_t read_chunk(int fd, uint64_t deadline_ns, uint8_t *bytes, uint32_t *count, char *why,
                                       size_t size)
{
    while (fcsl_monotonic_ns() < deadline_ns) {
        struct pollfd wait = {.fd = fd, .events = POLLIN};
        const struct timespec left = fcsl_time_left(deadline_ns);
        const int ready = ppoll(&wait, 1, &left, NULL);
        const ssize_t got = ready > 0 ? read(fd, bytes, CHUNK_BYTES) : ready;
        if (got > 0) {
            *count = (uint32_t)got;
            return FCSL_DRIVER_OK;
        }
        if (ready > 0 &&
            (got == 0 || errno == EIO || errno == ENODEV || errno == ENXIO)) { /* a hang-up reads as the end */
            (void)snprintf(why, size, "the serial device was unplugged");
            return FCSL_DRIVER_ABSENT;
        }
        if (ready != 0 && errno != EAGAIN && errno != EINTR) {
            (void)snprintf(why, size, "cannot read the serial device: %s", strerror(errno));
            return FCSL_DRIVER_FAILED;
        }
    }
    return FCSL_DRIVER_NOTHING;
}

fcsl_driver_status_t serial_sample(int fd, serial_take_t take, void *self, fcsl_driver_input_t *input,
                                   uint64_t *sample_ns, char *why, size_t size)
{
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)FCSL_DRIVER_WAIT_MS * FCSL_NS_PER_MS;
    uint8_t bytes[CHUNK_BYTES];
    uint32_t count = 0;
    fcsl_driver_status_t status = FCSL_DRIVER_OK;
    int found = 0;
    while (!found) { /* read_chunk ends it at the deadline */
        status = read_chunk(fd, deadline_ns, bytes, &count, why, size);
        if (status != FCSL_DRIVER_OK) {
            return status;
        }
        input->bytes += count;
        found = take(self, bytes, count, fcsl_monotonic_ns(), sample_ns);
    }
    return FCSL_DRIVER_OK;
}
