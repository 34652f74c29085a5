/* SPDX-License-Identifier: Apache-2.0
 *
 * A serial device: raw, 8 data bits, no parity, 1 stop bit, no flow control, for one process.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

#include "line.h"
#include "serial/serial.h"

enum { BITS_PER_BYTE = 10 };

static const struct {
    uint32_t baud;
    speed_t speed;
} SPEEDS[] = {
    {1200, B1200},       {2400, B2400},       {4800, B4800},       {9600, B9600},       {19200, B19200},
    {38400, B38400},     {57600, B57600},     {115200, B115200},   {230400, B230400},   {460800, B460800},
    {500000, B500000},   {576000, B576000},   {921600, B921600},   {1000000, B1000000}, {1152000, B1152000},
    {1500000, B1500000}, {2000000, B2000000}, {2500000, B2500000}, {3000000, B3000000}, {3500000, B3500000},
    {4000000, B4000000},
};

static const speed_t *speed_of(uint32_t baud)
{
    for (size_t i = 0; i < sizeof SPEEDS / sizeof SPEEDS[0]; i++) {
        if (SPEEDS[i].baud == baud) {
            return &SPEEDS[i].speed;
        }
    }
    return NULL;
}

int line_has_speed(uint32_t baud)
{
    return speed_of(baud) != NULL;
}

static int set_up(int fd, speed_t speed)
{
    struct termios options;
    if (tcgetattr(fd, &options) != 0) {
        return -1;
    }
    cfmakeraw(&options);
    options.c_iflag &= ~(tcflag_t)(IXOFF | IXANY | INPCK);
    options.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
    options.c_cflag |= CLOCAL | CREAD | CS8;
    options.c_cc[VMIN] = 1; /* with O_NONBLOCK: no byte is an error, and the end of the line is not */
    options.c_cc[VTIME] = 0;
    return cfsetispeed(&options, speed) == 0 && cfsetospeed(&options, speed) == 0 &&
                   tcsetattr(fd, TCSANOW, &options) == 0 && tcflush(fd, TCIOFLUSH) == 0
               ? 0
               : -1;
}

int line_open_uart(line_t *line, const char *device, uint32_t baud, fcsl_error_t *error)
{
    const speed_t *speed = speed_of(baud);
    *line = (line_t){.fd = -1, .listener = -1, .serial = 1};
    if (speed == NULL) {
        return fcsl_fail(error, "uart:%s:%" PRIu32 ": no serial device has this speed", device, baud);
    }
    line->frame_ns = (uint64_t)FCSL_COBS_BYTES_MAX * BITS_PER_BYTE * FCSL_NS_PER_S / baud;
    /* O_NONBLOCK: opening does not wait for a carrier. */
    const int fd = open(device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 || isatty(fd) == 0) {
        (void)fcsl_fail(error, fd < 0 ? "cannot open '%s': %s" : "'%s' is no serial device: %s", device,
                        strerror(errno));
    } else if (serial_take_for_us(fd) != 0) {
        (void)fcsl_fail(error, "'%s' is in use by another process", device);
    } else if (set_up(fd, *speed) != 0) {
        (void)fcsl_fail(error, "cannot set '%s' to %" PRIu32 " baud: %s", device, baud, strerror(errno));
    } else {
        line_begin(line, fd);
        return 0;
    }
    if (fd >= 0) {
        (void)close(fd);
    }
    return -1;
}
