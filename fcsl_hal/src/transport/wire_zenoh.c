/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire over the bus: each kind of message has its key. The simulator listens; liveliness tells each end of the other one.
 */
#define _GNU_SOURCE
#include "wire_zenoh.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "bus_peer.h"
#include "codec/codec_layout.h"
#include "handshake.h"

enum {
    WAITING_MAX = 8, /* messages; in lock-step there are two */
    CLOSE_MS = 2000, /* for the peer to take what was sent last */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside the message */
    TEXT_BYTES = 128
};

/* Of both ends, the control packets are output 0. */
enum { CONTROL = 0, SENSORS = 1, TIME = 2, ACTUATORS = 1, OUTPUTS_MAX = 3 };
static const char *const SIMULATOR_KEYS[] = {"fcsl/wire/simulator/control", "fcsl/wire/simulator/sensors",
                                             "fcsl/wire/simulator/time"};
static const char *const CONTROLLER_KEYS[] = {"fcsl/wire/controller/control", "fcsl/wire/controller/actuators"};
static const char SIMULATOR_ALL[] = "fcsl/wire/simulator/*";
static const char CONTROLLER_ALL[] = "fcsl/wire/controller/*";
static const char *const SIMULATOR_TOKEN[] = {"fcsl/wire/simulator"};
static const char *const CONTROLLER_TOKEN[] = {"fcsl/wire/controller"};
static const char *const TOKENS[] = {[BUS_CONTROLLERS] = "fcsl/wire/controller",
                                     [BUS_SIMULATORS] = "fcsl/wire/simulator"};

typedef struct {
    bus_peer_t peer;
    uint64_t too_large;
    size_t message_max;
    uint8_t *inbox; /* message_max bytes */
    char text[TEXT_BYTES];
} wire_t;

typedef fcsl_bus_counters_t counters_t;

#define COUNTER(path, member, doc) FCSL_WIRE_COUNTER(counters_t, path, member, doc)

static const fcsl_field_t FIELDS[] = {
    COUNTER("wire.posted", posted, "messages that the wire took"),
    COUNTER("wire.refused", refused, "messages for which there was no room"),
    COUNTER("wire.put", put, "messages that were handed to Zenoh"),
    COUNTER("wire.put_failed", put_failed, "messages that Zenoh refused"),
    COUNTER("wire.received", received, "messages that came"),
    COUNTER("wire.overflowed", overflowed, "messages dropped because earlier ones were not read"),
    COUNTER("wire.too_large", wrong_size, "messages dropped because they were too long"),
    COUNTER("wire.misfits", misfits, "messages dropped because they are none"),
    COUNTER("wire.deletions", deletions, "deletions, which are no messages"),
    COUNTER("wire.connects", connects, "sessions that connected to this one"),
    COUNTER("wire.disconnects", disconnects, "sessions that went"),
};

const fcsl_wire_counters_t fcsl_wire_zenoh_counters = {
    .fields = FIELDS, .field_count = sizeof FIELDS / sizeof FIELDS[0], .bytes = sizeof(counters_t)};

/* ---- messages --------------------------------------------------------------------------------------------------------- */

/* The key of a message: its first entry says what it is (codec_layout.h), and control packets begin otherwise. */
static uint32_t output_of(const wire_t *wire, const uint8_t *message, size_t size)
{
    const uint32_t id = size >= 2 ? (uint32_t)(message[0] | message[1] << 8) : 0u;
    if (wire->peer.side == FCSL_WIRE_CONNECT) {
        return id == SENSORS_ID + FCSL_ACTUATOR_MESSAGE ? ACTUATORS : CONTROL;
    }
    return id == SENSORS_ID + FCSL_SENSOR_MESSAGE ? SENSORS : id == SENSORS_ID + FCSL_TIME_MESSAGE ? TIME : CONTROL;
}

static fcsl_wire_status_t zenoh_send(void *ctx, const uint8_t *message, size_t size)
{
    wire_t *wire = ctx;
    if (!bus_peer_lives(&wire->peer)) {
        return FCSL_WIRE_CLOSED;
    }
    if (size > wire->message_max) {
        (void)snprintf(wire->text, sizeof wire->text, "a message of %zu bytes is longer than any of the machine", size);
        return FCSL_WIRE_ERROR;
    }
    return fcsl_bus_post(wire->peer.bus, output_of(wire, message, size), message, size) == 0 ? FCSL_WIRE_OK
                                                                                             : FCSL_WIRE_NONE;
}

/* Control packets, and messages of channels whose sum is right. */
static int is_message(uint64_t what, const uint8_t *bytes, size_t size)
{
    return handshake_fits(what, bytes, size) || message_is_whole(bytes, size);
}

/* The oldest message that fits, if there is one. What a peer sent comes before the news that it is gone. */
static fcsl_wire_status_t take(void *ctx, uint8_t *message, size_t capacity, size_t *size)
{
    wire_t *wire = ctx;
    size_t length = 0;
    const int lives = bus_peer_lives(&wire->peer); /* looked at first: what it sent is there then */
    const int met = bus_peer_meet(&wire->peer);
    while (met && fcsl_bus_take(wire->peer.bus, 0, wire->inbox, &length)) { /* every turn takes one */
        if (length <= capacity) {
            memcpy(message, wire->inbox, length);
            *size = length;
            return FCSL_WIRE_OK;
        }
        wire->too_large++;
    }
    return lives ? FCSL_WIRE_NONE : bus_peer_disconnected(&wire->peer);
}

static fcsl_wire_status_t zenoh_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity,
                                        size_t *size)
{
    wire_t *wire = ctx;
    return bus_peer_receive(&wire->peer, take, wire, deadline_ns, message, capacity, size);
}

static const char *zenoh_explain(void *ctx)
{
    return ((const wire_t *)ctx)->text;
}

static void zenoh_count(void *ctx, void *values)
{
    const wire_t *wire = ctx;
    counters_t now;
    fcsl_bus_count(wire->peer.bus, &now);
    now.wrong_size += wire->too_large;
    memcpy(values, &now, sizeof now);
}

static void release(wire_t *wire)
{
    free(wire->inbox);
    free(wire);
}

static void zenoh_close(void *ctx)
{
    wire_t *wire = ctx;
    (void)fcsl_bus_close(wire->peer.bus, CLOSE_MS); /* what Zenoh leaves behind ends with the program */
    release(wire);
}

/* ---- opening ---------------------------------------------------------------------------------------------------------- */

static int open_session(wire_t *wire, const char *endpoint, uint64_t deadline_ns, fcsl_error_t *error)
{
    const int listens = wire->peer.side == FCSL_WIRE_LISTEN;
    const uint64_t now_ns = fcsl_monotonic_ns();
    const fcsl_bus_input_t input = {.key = listens ? CONTROLLER_ALL : SIMULATOR_ALL,
                                    .bytes = (uint32_t)wire->message_max,
                                    .depth = WAITING_MAX,
                                    .fits = is_message};
    const fcsl_bus_options_t options = {
        .role = listens ? FCSL_BUS_LISTEN : FCSL_BUS_CLIENT,
        .endpoint = endpoint,
        .timeout_ms = deadline_ns > now_ns ? (uint32_t)((deadline_ns - now_ns) / FCSL_NS_PER_MS) : 0u,
        .ring_bytes = WAITING_MAX * ((uint32_t)wire->message_max + ENTRY_BYTES_MAX),
        .outputs = listens ? SIMULATOR_KEYS : CONTROLLER_KEYS,
        .output_count = wire->peer.output_count,
        .inputs = &input,
        .input_count = 1,
        .tokens = listens ? SIMULATOR_TOKEN : CONTROLLER_TOKEN,
        .token_count = 1,
        .watched = TOKENS,
        .watched_count = bus_peer_watched(wire->peer.side),
    };
    return fcsl_bus_open(&options, &wire->peer.bus, error);
}

int fcsl_wire_open_zenoh(const char *endpoint, fcsl_wire_side_t side, size_t message_max, uint64_t deadline_ns,
                         fcsl_wire_t *wire, fcsl_error_t *error)
{
    if (message_max > FCSL_BUS_MESSAGE_MAX) {
        return fcsl_fail(error, "a message of the machine may have %zu bytes, and the bus carries %u", message_max,
                         FCSL_BUS_MESSAGE_MAX);
    }
    wire_t *self = calloc(1, sizeof *self);
    uint8_t *inbox = malloc(message_max);
    if (self == NULL || inbox == NULL) {
        free(self);
        free(inbox);
        return fcsl_fail(error, "out of memory for the wire");
    }
    self->peer.side = side;
    self->message_max = message_max;
    self->inbox = inbox;
    self->peer.output_count = side == FCSL_WIRE_LISTEN ? sizeof SIMULATOR_KEYS / sizeof SIMULATOR_KEYS[0]
                                                       : sizeof CONTROLLER_KEYS / sizeof CONTROLLER_KEYS[0];
    if (open_session(self, endpoint, deadline_ns, error) != 0) {
        release(self);
        return -1;
    }
    if (side == FCSL_WIRE_CONNECT && bus_peer_wait(&self->peer, endpoint, deadline_ns, error) != 0) {
        zenoh_close(self);
        return -1;
    }
    *wire = (fcsl_wire_t){
        .ctx = self,
        .send = zenoh_send,
        .receive = zenoh_receive,
        .explain = zenoh_explain,
        .close = zenoh_close,
        .counters = &fcsl_wire_zenoh_counters,
        .count = zenoh_count,
    };
    return 0;
}
