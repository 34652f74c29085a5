/* SPDX-License-Identifier: Apache-2.0
 *
 * UDP: one end binds the address, the other sends to it.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_address.h"
#include "line.h"

int line_open_udp(line_t *line, const char *address, fcsl_wire_side_t side, fcsl_error_t *error)
{
    struct sockaddr_storage there;
    socklen_t length = 0;
    const int listens = side == FCSL_WIRE_LISTEN;
    *line = (line_t){.fd = -1, .listener = -1, .datagrams = 1, .answers = listens};
    if (fcsl_address_read(address, &there, &length) != 0) {
        return fcsl_fail(error, "udp:%s: HOST:PORT must be numbers, like 127.0.0.1:7600", address);
    }
    const int fd = socket(there.ss_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int done = fd < 0    ? -1
                     : listens ? bind(fd, (const struct sockaddr *)&there, length)
                               : connect(fd, (const struct sockaddr *)&there, length);
    if (done != 0) {
        (void)fcsl_fail(error, "cannot %s udp:%s: %s", listens ? "bind" : "reach", address, strerror(errno));
        if (fd >= 0) {
            (void)close(fd);
        }
        return -1;
    }
    line->fd = fd;
    return 0;
}
