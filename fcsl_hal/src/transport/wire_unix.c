/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire over a Unix socket of sequenced packets: a message is a packet. The system delivers all, in order.
 */
#define _GNU_SOURCE
#include "wire_unix.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_socket.h"

enum { BACKLOG = 4, TEXT_BYTES = 256, PATH_BYTES = 128, RETRY_MS = 20 };

typedef struct {
    uint64_t peers;
    uint64_t too_large;
} counters_t;

typedef struct {
    int listener; /* -1: this end connected */
    int fd;       /* -1: no peer now */
    int spoken;   /* something was sent to this peer: until then a newer one replaces it */
    size_t message_max;
    counters_t counters;
    char path[PATH_BYTES];
    char text[TEXT_BYTES];
} wire_t;

static const fcsl_field_t FIELDS[] = {
    FCSL_WIRE_COUNTER(counters_t, "wire.peers", peers, "peers that have connected so far"),
    FCSL_WIRE_COUNTER(counters_t, "wire.too_large", too_large, "messages dropped because they were too long"),
};

const fcsl_wire_counters_t fcsl_wire_unix_counters = {
    .fields = FIELDS, .field_count = sizeof FIELDS / sizeof FIELDS[0], .bytes = sizeof(counters_t)};

static fcsl_wire_status_t fail(wire_t *wire, const char *what)
{
    (void)snprintf(wire->text, sizeof wire->text, "%s: %s", what, strerror(errno));
    return FCSL_WIRE_ERROR;
}

static fcsl_wire_status_t drop_peer(wire_t *wire)
{
    (void)close(wire->fd);
    wire->fd = -1;
    return FCSL_WIRE_CLOSED;
}

/* Makes room for whole messages in the send buffer, with the kernel's own bookkeeping; two may be under way. */
static int size_buffer(int fd, size_t message_max)
{
    const size_t wanted = 2u * message_max + 4096u;
    int value = wanted > INT_MAX / 4 ? INT_MAX / 4 : (int)wanted;
    int have = 0;
    socklen_t length = sizeof have;
    if (getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &have, &length) == 0 && have / 2 >= value) {
        return 0;
    }
    if (setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &value, sizeof value) != 0 ||
        getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &have, &length) != 0) {
        return -1;
    }
    /* Linux reports twice what it grants. */
    if (have / 2 < value) {
        errno = EMSGSIZE;
        return -1;
    }
    return 0;
}

static fcsl_wire_status_t unix_send(void *ctx, const uint8_t *message, size_t size)
{
    wire_t *wire = ctx;
    if (wire->fd < 0) {
        return FCSL_WIRE_CLOSED;
    }
    wire->spoken = 1;
    if (send(wire->fd, message, size, MSG_NOSIGNAL | MSG_DONTWAIT) >= 0) { /* whole or not at all */
        return FCSL_WIRE_OK;
    }
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS) {
        return FCSL_WIRE_NONE;
    }
    /* What the peer sent before it went is still there to be received. */
    return errno == EPIPE || errno == ECONNRESET ? FCSL_WIRE_CLOSED : fail(wire, "cannot send");
}

/* Takes the peer that waits on the listener, if it is still there. One that only holds a connection keeps nobody out. */
static fcsl_wire_status_t take_peer(wire_t *wire)
{
    const int fd = accept4(wire->listener, NULL, NULL, SOCK_CLOEXEC);
    if (fd < 0) {
        return errno == ECONNABORTED || errno == EAGAIN || errno == EINTR ? FCSL_WIRE_NONE
                                                                          : fail(wire, "cannot accept a peer");
    }
    if (wire->fd >= 0) {
        (void)drop_peer(wire);
    }
    wire->fd = fd;
    wire->spoken = 0;
    wire->counters.peers++;
    return size_buffer(fd, wire->message_max) == 0 ? FCSL_WIRE_NONE
                                                   : fail(wire, "cannot make room for a message in the socket");
}

/* Takes the packet that waits, if there is one. */
static fcsl_wire_status_t take_packet(wire_t *wire, uint8_t *message, size_t capacity, size_t *size)
{
    ssize_t got = recv(wire->fd, message, capacity, MSG_DONTWAIT | MSG_TRUNC);
    if (got < 0 && errno == ECONNRESET) { /* comes before what the peer has sent last */
        got = recv(wire->fd, message, capacity, MSG_DONTWAIT | MSG_TRUNC);
    }
    while (got > 0 && (size_t)got > capacity) { /* every turn takes a packet out of the socket */
        wire->counters.too_large++;
        got = recv(wire->fd, message, capacity, MSG_DONTWAIT | MSG_TRUNC);
    }
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
        return FCSL_WIRE_NONE;
    }
    if (got <= 0) {
        return drop_peer(wire);
    }
    *size = (size_t)got;
    return FCSL_WIRE_OK;
}

static fcsl_wire_status_t unix_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity, size_t *size)
{
    wire_t *wire = ctx;
    if (wire->fd < 0 && wire->listener < 0) {
        return FCSL_WIRE_CLOSED;
    }
    fcsl_wire_status_t status = FCSL_WIRE_NONE;
    do { /* ends at the deadline, whatever arrives */
        const int listens = wire->listener >= 0 && (wire->fd < 0 || !wire->spoken);
        struct pollfd entries[2] = {{.fd = wire->fd, .events = POLLIN},
                                    {.fd = listens ? wire->listener : -1, .events = POLLIN}}; /* -1 is passed over */
        const struct timespec left = fcsl_time_left(deadline_ns);
        const int ready = ppoll(entries, 2, &left, NULL);
        if (ready <= 0) {
            return ready == 0 || errno == EINTR ? FCSL_WIRE_NONE : fail(wire, "cannot wait for a message");
        }
        /* What a peer has said comes before the next peer. */
        status = entries[0].revents != 0 ? take_packet(wire, message, capacity, size) : take_peer(wire);
    } while (status == FCSL_WIRE_NONE && fcsl_monotonic_ns() < deadline_ns);
    return status;
}

static const char *unix_explain(void *ctx)
{
    return ((const wire_t *)ctx)->text;
}

static void unix_close(void *ctx)
{
    wire_t *wire = ctx;
    if (wire->fd >= 0) {
        (void)close(wire->fd);
    }
    if (wire->listener >= 0) {
        (void)close(wire->listener);
        (void)unlink(wire->path);
    }
    free(wire);
}

static void unix_count(void *ctx, void *values)
{
    memcpy(values, &((const wire_t *)ctx)->counters, sizeof(counters_t));
}

/* 0, 1 where nobody was there until then, or -1. */
static int connect_until(wire_t *wire, uint64_t deadline_ns, fcsl_error_t *error)
{
    for (;;) {
        wire->fd = fcsl_socket_connect(wire->path, SOCK_SEQPACKET, error);
        if (wire->fd >= 0 || fcsl_monotonic_ns() >= deadline_ns) {
            break;
        }
        const struct timespec pause = {.tv_nsec = RETRY_MS * FCSL_NS_PER_MS};
        (void)nanosleep(&pause, NULL);
    }
    if (wire->fd >= 0 && size_buffer(wire->fd, wire->message_max) != 0) {
        return fcsl_fail(error, "cannot make room for a message in the socket: %s", strerror(errno));
    }
    return wire->fd >= 0 ? 0 : 1;
}

int fcsl_wire_open_unix(const char *path, fcsl_wire_side_t side, size_t message_max, uint64_t deadline_ns,
                        fcsl_wire_t *wire, fcsl_error_t *error)
{
    wire_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return fcsl_fail(error, "out of memory for the wire");
    }
    self->listener = -1;
    self->fd = -1;
    self->message_max = message_max;
    (void)snprintf(self->path, sizeof self->path, "%s", path); /* a longer one does not open */
    int failed = 0;
    if (side == FCSL_WIRE_LISTEN) {
        self->listener = fcsl_socket_listen(path, SOCK_SEQPACKET, BACKLOG, error);
        failed = self->listener < 0 ? -1 : 0;
    } else {
        failed = connect_until(self, deadline_ns, error);
    }
    if (failed) {
        unix_close(self);
        return failed;
    }
    *wire = (fcsl_wire_t){
        .ctx = self,
        .send = unix_send,
        .receive = unix_receive,
        .explain = unix_explain,
        .close = unix_close,
        .counters = &fcsl_wire_unix_counters,
        .count = unix_count,
    };
    return 0;
}
