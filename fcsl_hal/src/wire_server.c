/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulator's end of the wire.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_wire.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "fcsl/fcsl_socket.h"
#include "wire_packet.h"

enum { BACKLOG = 4, TEXT_BYTES = 512, PATH_BYTES = 128 };

struct fcsl_wire {
    fcsl_channel_table_t table;
    int listener;
    int peer;
    uint64_t messages_dropped;
    uint8_t *inbox;
    size_t inbox_size;
    char path[PATH_BYTES];
    char text[TEXT_BYTES];
};

int fcsl_wire_listen(const char *socket_path, const fcsl_machine_t *machine, fcsl_wire_t **wire, char *error,
                     size_t error_size)
{
    fcsl_wire_t *self = calloc(1, sizeof *self);
    const size_t capacity = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    const size_t inbox_size = capacity > FCSL_WIRE_PACKET_MAX ? capacity : FCSL_WIRE_PACKET_MAX;
    uint8_t *inbox = malloc(inbox_size);
    if (self == NULL || inbox == NULL) {
        free(self);
        free(inbox);
        (void)snprintf(error, error_size, "out of memory for the wire");
        return -1;
    }
    self->table = fcsl_channel_table(machine);
    self->peer = -1;
    self->inbox = inbox;
    self->inbox_size = inbox_size;
    self->listener = fcsl_socket_listen(socket_path, SOCK_SEQPACKET, BACKLOG, error, error_size);
    if (self->listener < 0) {
        free(inbox);
        free(self);
        return -1;
    }
    (void)snprintf(self->path, sizeof self->path, "%s", socket_path);
    *wire = self;
    return 0;
}

static fcsl_hal_status_t fail(fcsl_wire_t *wire, const char *what)
{
    (void)snprintf(wire->text, sizeof wire->text, "%s: %s", what, strerror(errno));
    return FCSL_HAL_ERROR;
}

static void drop_peer(fcsl_wire_t *wire)
{
    if (wire->peer >= 0) {
        (void)close(wire->peer);
        wire->peer = -1;
    }
}

/* Reads the hello of a fresh connection: OK, CLOSED when this was no controller at all (try the next one), or ERROR. */
static fcsl_hal_status_t shake_hands(fcsl_wire_t *wire, uint64_t deadline_ms)
{
    const int ready = fcsl_wire_wait_readable(wire->peer, deadline_ms);
    if (ready < 0) {
        return errno == EINTR ? FCSL_HAL_NONE : fail(wire, "cannot wait for the controller's handshake");
    }
    if (ready == 0) {
        return FCSL_HAL_CLOSED;
    }
    fcsl_wire_packet_t hello;
    const ssize_t size = recv(wire->peer, wire->inbox, wire->inbox_size, MSG_DONTWAIT);
    if (size <= 0 || fcsl_wire_parse(wire->inbox, (size_t)size, &hello) != 0 || hello.kind != FCSL_WIRE_HELLO) {
        return FCSL_HAL_CLOSED;
    }
    char text[FCSL_WIRE_TEXT_MAX + 1];
    if (fcsl_wire_differs(&hello, &wire->table, text, sizeof text)) {
        (void)fcsl_wire_send_refusal(wire->peer, text);
        (void)snprintf(wire->text, sizeof wire->text, "controller refused: %s", text);
        return FCSL_HAL_ERROR;
    }
    if (fcsl_wire_size_buffers(wire->peer, fcsl_message_capacity(wire->table.machine, FCSL_SENSOR_MESSAGE)) != 0) {
        return fail(wire, "cannot make room for a sensor message in the socket");
    }
    return fcsl_wire_send_hello(wire->peer, &wire->table) == 0 ? FCSL_HAL_OK : FCSL_HAL_CLOSED;
}

fcsl_hal_status_t fcsl_wire_accept(fcsl_wire_t *wire, uint32_t timeout_ms)
{
    const uint64_t deadline_ms = fcsl_wire_now_ms() + timeout_ms;
    drop_peer(wire);
    /* Ends at the deadline: wait_readable returns 0 then, and connections that are no controllers are finite. */
    for (;;) {
        const int ready = fcsl_wire_wait_readable(wire->listener, deadline_ms);
        if (ready < 0) {
            return errno == EINTR ? FCSL_HAL_NONE : fail(wire, "cannot wait for the controller");
        }
        if (ready == 0) {
            (void)snprintf(wire->text, sizeof wire->text, "no controller on socket '%s' within %" PRIu32 " ms",
                           wire->path, timeout_ms);
            return FCSL_HAL_TIMEOUT;
        }
        wire->peer = accept4(wire->listener, NULL, NULL, SOCK_CLOEXEC);
        if (wire->peer < 0) {
            if (errno == ECONNABORTED || errno == EAGAIN) {
                continue;
            }
            return errno == EINTR ? FCSL_HAL_NONE : fail(wire, "cannot accept the controller");
        }
        const fcsl_hal_status_t status = shake_hands(wire, deadline_ms);
        if (status == FCSL_HAL_OK) {
            return status;
        }
        drop_peer(wire);
        if (status != FCSL_HAL_CLOSED) {
            return status;
        }
    }
}

fcsl_hal_status_t fcsl_wire_send(fcsl_wire_t *wire, const uint8_t *message, size_t size)
{
    if (wire->peer >= 0 &&
        send(wire->peer, message, size, MSG_NOSIGNAL | MSG_DONTWAIT) >= 0) { /* whole or not at all */
        return FCSL_HAL_OK;
    }
    if (wire->peer >= 0 && errno != EPIPE && errno != ECONNRESET) {
        return fail(wire,
                    errno == EAGAIN ? "the controller takes no sensor messages" : "cannot send the sensor message");
    }
    (void)snprintf(wire->text, sizeof wire->text, "the controller is gone");
    return FCSL_HAL_CLOSED;
}

fcsl_hal_status_t fcsl_wire_receive(fcsl_wire_t *wire, uint64_t tick, uint32_t timeout_ms, fcsl_message_t *message)
{
    const uint64_t deadline_ms = fcsl_wire_now_ms() + timeout_ms;
    /* Every turn takes one packet off the socket or ends. */
    for (;;) {
        const int ready = wire->peer < 0 ? 1 : fcsl_wire_wait_readable(wire->peer, deadline_ms);
        if (ready < 0) {
            return errno == EINTR ? FCSL_HAL_NONE : fail(wire, "cannot wait for the actuator message");
        }
        if (ready == 0) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "no actuator message of tick %" PRIu64 " within %" PRIu32 " ms (%" PRIu64
                           " malformed or late messages dropped)",
                           tick, timeout_ms, wire->messages_dropped);
            return FCSL_HAL_TIMEOUT;
        }
        const ssize_t got =
            wire->peer < 0 ? 0 : recv(wire->peer, wire->inbox, wire->inbox_size, MSG_DONTWAIT | MSG_TRUNC);
        if (got < 0 && errno == EAGAIN) {
            continue;
        }
        if (got <= 0) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "the controller went away before actuator message of tick %" PRIu64, tick);
            return FCSL_HAL_CLOSED;
        }
        if ((size_t)got > wire->inbox_size ||
            fcsl_message_check(&wire->table, FCSL_ACTUATOR_MESSAGE, wire->inbox, (size_t)got, message) !=
                FCSL_MESSAGE_OK ||
            message->tick < tick) {
            wire->messages_dropped++;
            continue;
        }
        if (message->tick > tick) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "actuator message of tick %" PRIu64 " came while tick %" PRIu64 " was due", message->tick,
                           tick);
            return FCSL_HAL_ERROR;
        }
        return FCSL_HAL_OK;
    }
}

const char *fcsl_wire_explain(const fcsl_wire_t *wire)
{
    return wire->text;
}

uint64_t fcsl_wire_messages_dropped(const fcsl_wire_t *wire)
{
    return wire->messages_dropped;
}

void fcsl_wire_close(fcsl_wire_t *wire)
{
    if (wire == NULL) {
        return;
    }
    if (wire->peer >= 0) {
        (void)fcsl_wire_send_end(wire->peer);
    }
    drop_peer(wire);
    (void)close(wire->listener);
    (void)unlink(wire->path);
    free(wire->inbox);
    free(wire);
}
