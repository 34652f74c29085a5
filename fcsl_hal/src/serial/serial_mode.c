/* SPDX-License-Identifier: Apache-2.0
 *
 * The mode of a tty by termios2, which takes any baud rate. A file of its own: <asm/termbits.h> and <termios.h> exclude each other.
 */
#include "serial.h"

#include <asm/termbits.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>

/* A UART divides its clock by a whole number. Beyond this difference bytes are damaged. */
enum { BAUD_TOLERANCE_PERCENT = 3 };

static int is_near(uint32_t baud, uint32_t wanted)
{
    const uint64_t difference = baud > wanted ? baud - wanted : wanted - baud;
    return difference * 100u <= (uint64_t)wanted * BAUD_TOLERANCE_PERCENT;
}

int serial_set_mode(int fd, const serial_mode_t *mode, char *why, size_t size)
{
    struct termios2 options = {0};
    if (ioctl(fd, TCGETS2, &options) != 0) {
        (void)snprintf(why, size, "cannot read the mode of the serial device: %s", strerror(errno));
        return -1;
    }
    options.c_iflag = IGNBRK | INPCK | IGNPAR; /* drops bytes with a wrong parity or stop bit */
    options.c_oflag = 0;
    options.c_lflag = 0;
    options.c_cflag = BOTHER | CS8 | CREAD | CLOCAL;
    options.c_cflag |= mode->even_parity ? PARENB : 0u;
    options.c_cflag |= mode->two_stop_bits ? CSTOPB : 0u;
    options.c_ispeed = mode->baud;
    options.c_ospeed = mode->baud;
    options.c_cc[VMIN] = 1; /* with O_NONBLOCK: no byte is an error, and the end of the line is not */
    options.c_cc[VTIME] = 0;
    if (ioctl(fd, TCSETS2, &options) != 0 || ioctl(fd, TCFLSH, TCIOFLUSH) != 0 || ioctl(fd, TCGETS2, &options) != 0) {
        (void)snprintf(why, size, "cannot set %" PRIu32 " baud: %s", mode->baud, strerror(errno));
        return -1;
    }
    if (!is_near(options.c_ospeed, mode->baud)) {
        (void)snprintf(why, size, "the serial device has no %" PRIu32 " baud, the nearest is %" PRIu32, mode->baud,
                       (uint32_t)options.c_ospeed);
        return -1;
    }
    return 0;
}
