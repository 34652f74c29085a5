/* SPDX-License-Identifier: Apache-2.0
 *
 * TCP: one end listens, the other connects. A connection is a stream of COBS frames.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_address.h"
#include "line.h"

enum { BACKLOG = 4, RETRY_MS = 20 };

static int fail(int fd, const char *what, const char *address, fcsl_error_t *error)
{
    (void)fcsl_fail(error, "cannot %s tcp:%s: %s", what, address, strerror(errno));
    if (fd >= 0) {
        (void)close(fd);
    }
    return -1;
}

/* Frames are short and wait for nothing. */
static int set_up(int fd)
{
    const int on = 1;
    return setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on) == 0 ? line_set_nonblocking(fd) : -1;
}

static int listen_at(const struct sockaddr_storage *there, socklen_t length, const char *address, fcsl_error_t *error)
{
    const int on = 1;
    const int fd = socket(there->ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        bind(fd, (const struct sockaddr *)there, length) != 0 || listen(fd, BACKLOG) != 0) {
        return fail(fd, "listen on", address, error);
    }
    return fd;
}

/* Where nobody listens on a port of this computer, the system may give the same one to who connects: to itself, then. */
static int is_own(int fd)
{
    struct sockaddr_storage ours = {0};
    struct sockaddr_storage theirs = {0};
    socklen_t length = sizeof ours;
    socklen_t their_length = sizeof theirs;
    return getsockname(fd, (struct sockaddr *)&ours, &length) == 0 &&
           getpeername(fd, (struct sockaddr *)&theirs, &their_length) == 0 && length == their_length &&
           memcmp(&ours, &theirs, length) == 0;
}

/* Returns a descriptor; -1 with errno. */
static int connect_once(const struct sockaddr_storage *there, socklen_t length, uint64_t deadline_ns)
{
    const int fd = socket(there->ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return -1;
    }
    int code = connect(fd, (const struct sockaddr *)there, length) == 0 ? 0 : errno;
    if (code == EINPROGRESS) {
        struct pollfd entry = {.fd = fd, .events = POLLOUT};
        const struct timespec left = fcsl_time_left(deadline_ns);
        socklen_t size = sizeof code;
        if (ppoll(&entry, 1, &left, NULL) <= 0 || getsockopt(fd, SOL_SOCKET, SO_ERROR, &code, &size) != 0) {
            code = ETIMEDOUT;
        }
    }
    if (code == 0 && !is_own(fd)) {
        return fd;
    }
    (void)close(fd);
    errno = code == 0 ? ECONNREFUSED : code;
    return -1;
}

int line_open_tcp(line_t *line, const char *address, fcsl_wire_side_t side, uint64_t deadline_ns, fcsl_error_t *error)
{
    struct sockaddr_storage there;
    socklen_t length = 0;
    *line = (line_t){.fd = -1, .listener = -1};
    if (fcsl_address_read(address, &there, &length) != 0) {
        return fcsl_fail(error, "tcp:%s: HOST:PORT must be numbers, like 127.0.0.1:7600", address);
    }
    if (side == FCSL_WIRE_LISTEN) {
        line->listener = listen_at(&there, length, address, error);
        return line->listener >= 0 ? 0 : -1;
    }
    int fd = connect_once(&there, length, deadline_ns);
    while (fd < 0 && fcsl_monotonic_ns() < deadline_ns) { /* nobody listens yet, or the host is not up yet */
        const struct timespec pause = {.tv_nsec = RETRY_MS * FCSL_NS_PER_MS};
        (void)nanosleep(&pause, NULL);
        fd = connect_once(&there, length, deadline_ns);
    }
    if (fd < 0 || set_up(fd) != 0) {
        return fail(fd, "connect to", address, error);
    }
    line_begin(line, fd);
    return 0;
}

int line_accept(line_t *line)
{
    const int fd = accept4(line->listener, NULL, NULL, SOCK_CLOEXEC);
    if (fd < 0) {
        return -1;
    }
    line_drop(line);
    if (set_up(fd) != 0) {
        (void)close(fd);
        return -1;
    }
    line_begin(line, fd);
    return 0;
}
