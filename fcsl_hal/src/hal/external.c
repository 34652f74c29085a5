/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulator's end of a wire.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_error.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_monotonic.h"
#include "named_values/wire_named.h"
#include "presence.h"
#include "transport/handshake.h"

enum {
    TEXT_BYTES = 512,
    SPEC_BYTES = 256,
    TIME_BYTES = 64,
    JOIN_MS = 10000,
    MESSAGES_MAX = 64, /* that one call takes */
    POLL_NS = 20 * FCSL_NS_PER_MS, /* a moment */
};

static const struct timespec PAUSE = {.tv_nsec = 20 * FCSL_NS_PER_MS};

struct fcsl_external {
    fcsl_channel_table_t table;
    fcsl_wire_t wire;
    uint64_t messages_dropped;
    int runs_free;
    presence_t presence; /* of a controller that runs free, too */
    fcsl_log_t log;
    fcsl_external_counters_t counters; /* free-running */
    uint64_t ticks_without; /* since the last actuator message */
    int waits; /* for an actuator message, until deadline_ns */
    uint64_t deadline_ns;
    uint64_t keep_alive_ns; /* when the next sign of life is due */
    int ended; /* the controller was told */
    uint8_t *inbox;
    size_t inbox_size;
    char spec[SPEC_BYTES];
    char text[TEXT_BYTES];
};

/* Bytes of the longest message to the controller, or from it. */
static size_t inbox_bytes(const fcsl_machine_t *machine)
{
    const size_t actuators = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    return actuators > HANDSHAKE_PACKET_MAX ? actuators : HANDSHAKE_PACKET_MAX;
}

/* Everything but the wire. Returns null with `error` filled. */
static fcsl_external_t *create(const fcsl_machine_t *machine, const char *where, fcsl_error_t *error)
{
    fcsl_external_t *self = calloc(1, sizeof *self);
    uint8_t *inbox = malloc(inbox_bytes(machine));
    if (self == NULL || inbox == NULL) {
        free(self);
        free(inbox);
        (void)fcsl_fail(error, "out of memory for the wire");
        return NULL;
    }
    self->table = fcsl_channel_table(machine);
    self->inbox = inbox;
    self->inbox_size = inbox_bytes(machine);
    (void)snprintf(self->spec, sizeof self->spec, "%s", where);
    return self;
}

static void release(fcsl_external_t *external)
{
    free(external->inbox);
    free(external);
}

int fcsl_external_over_wire(const fcsl_wire_t *wire, const fcsl_machine_t *machine, fcsl_external_t **external,
                            fcsl_error_t *error)
{
    fcsl_external_t *self = create(machine, "the wire", error);
    if (self == NULL) {
        return -1;
    }
    self->wire = *wire;
    *external = self;
    return 0;
}

int fcsl_external_open(const char *spec, const fcsl_machine_t *machine, fcsl_external_t **external, fcsl_error_t *error)
{
    const size_t sensors = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    const size_t inbox = inbox_bytes(machine);
    fcsl_external_t *self = create(machine, spec, error);
    if (self == NULL) {
        return -1;
    }
    if (fcsl_wire_open(spec, FCSL_WIRE_LISTEN, sensors > inbox ? sensors : inbox, 0, &self->wire, error) != 0) {
        release(self);
        return -1;
    }
    *external = self;
    return 0;
}

int fcsl_external_open_bus(const char *address, const char *name_space, const fcsl_machine_t *machine,
                           fcsl_external_t **external, fcsl_error_t *error)
{
    fcsl_external_t *self = create(machine, address, error);
    if (self == NULL) {
        return -1;
    }
    self->runs_free = fcsl_wire_runs_free(address);
    self->presence = presence_of(FCSL_WIRE_CONNECT, &self->table, &self->log);
    /* A client of another simulator, which may be started later; who listens waits for nobody. */
    const uint64_t deadline_ns = fcsl_monotonic_ns() + JOIN_MS * (uint64_t)FCSL_NS_PER_MS;
    if (fcsl_wire_open_named(self->spec, name_space, &self->table, FCSL_WIRE_LISTEN, deadline_ns, &self->wire, error) !=
        0) {
        release(self);
        return -1;
    }
    *external = self;
    return 0;
}

static fcsl_hal_status_t wire_failed(fcsl_external_t *external)
{
    (void)snprintf(external->text, sizeof external->text, "%s", external->wire.explain(external->wire.ctx));
    return FCSL_HAL_ERROR;
}

/* Waits for a message, for a short time at most. */
static fcsl_wire_status_t receive(fcsl_external_t *external, uint64_t deadline_ns, size_t *size)
{
    const uint64_t poll_ns = fcsl_monotonic_ns() + POLL_NS;
    return external->wire.receive(external->wire.ctx, poll_ns < deadline_ns ? poll_ns : deadline_ns, external->inbox,
                                  external->inbox_size, size);
}

/* Whether a wait that began then, and brought nothing, was ended by a signal. */
static int is_early(uint64_t begun_ns, uint64_t deadline_ns)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    return now_ns < begun_ns + POLL_NS && now_ns < deadline_ns;
}

/* ---- meeting ------------------------------------------------------------------------------------------------------- */

/* Answers a hello: OK, ERROR, or NONE when the controller has left in the meantime. */
static fcsl_hal_status_t answer(fcsl_external_t *external, const handshake_packet_t *hello)
{
    char text[HANDSHAKE_TEXT_MAX + 1];
    int refused = handshake_differs(hello, &external->table, text, sizeof text);
    if (!refused && hello->flag) {
        (void)snprintf(text, sizeof text, "one of them runs free: write ,free-running behind both addresses, or none");
        refused = 1;
    }
    if (refused) {
        (void)handshake_send_refusal(&external->wire, text);
        (void)snprintf(external->text, sizeof external->text, "controller refused: %s", text);
        return FCSL_HAL_ERROR;
    }
    const fcsl_wire_status_t status = handshake_send_hello(&external->wire, &external->table, 1);
    if (status == FCSL_WIRE_ERROR) {
        return wire_failed(external);
    }
    return status == FCSL_WIRE_OK ? FCSL_HAL_OK : FCSL_HAL_NONE;
}

/* Looks at what came, or did not: OK when the controller is there, NONE to wait on. */
static fcsl_hal_status_t meet(fcsl_external_t *external, fcsl_wire_status_t status, size_t size)
{
    handshake_packet_t hello;
    if (status == FCSL_WIRE_ERROR) {
        return wire_failed(external);
    }
    if (status == FCSL_WIRE_CLOSED) { /* a wire that cannot be connected again says so at once, again and again */
        (void)nanosleep(&PAUSE, NULL);
    }
    if (status == FCSL_WIRE_OK && handshake_parse(external->inbox, size, &hello) == 0 &&
        hello.kind == HANDSHAKE_HELLO) {
        return answer(external, &hello);
    }
    external->messages_dropped += status == FCSL_WIRE_OK ? 1u : 0u;
    return FCSL_HAL_NONE;
}

fcsl_hal_status_t fcsl_external_accept(fcsl_external_t *external, uint32_t timeout_ms)
{
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)timeout_ms * FCSL_NS_PER_MS;
    do { /* every turn takes a message or waits; whoever is no controller is passed over */
        size_t size = 0;
        const uint64_t begun_ns = fcsl_monotonic_ns();
        const fcsl_wire_status_t status = receive(external, deadline_ns, &size);
        if (status == FCSL_WIRE_NONE && is_early(begun_ns, deadline_ns)) {
            return FCSL_HAL_NONE;
        }
        const fcsl_hal_status_t met = meet(external, status, size);
        if (met != FCSL_HAL_NONE) {
            return met;
        }
    } while (fcsl_monotonic_ns() < deadline_ns);
    (void)snprintf(external->text, sizeof external->text, "no controller on %s", external->spec);
    return FCSL_HAL_TIMEOUT;
}

/* ---- a tick -------------------------------------------------------------------------------------------------------- */

static fcsl_hal_status_t judge(fcsl_external_t *external, fcsl_wire_status_t status)
{
    switch (status) {
    case FCSL_WIRE_OK:
        return FCSL_HAL_OK;
    case FCSL_WIRE_NONE:
        if (external->runs_free) {
            return FCSL_HAL_OK; /* the next ones are newer */
        }
        (void)snprintf(external->text, sizeof external->text, "the controller takes no sensor messages");
        return FCSL_HAL_ERROR;
    case FCSL_WIRE_CLOSED:
        (void)snprintf(external->text, sizeof external->text, "the controller is gone");
        return FCSL_HAL_CLOSED;
    default:
        return wire_failed(external);
    }
}

fcsl_hal_status_t fcsl_external_send(fcsl_external_t *external, const fcsl_message_t *sensors, uint64_t time_ns)
{
    uint8_t bytes[TIME_BYTES];
    fcsl_message_t time;
    const fcsl_message_status_t encoded =
        fcsl_message_encode_time(&external->table, sensors->tick, time_ns, bytes, sizeof bytes, &time);
    if (encoded != FCSL_MESSAGE_OK) {
        (void)snprintf(external->text, sizeof external->text, "time message: %s", fcsl_message_status_text(encoded));
        return FCSL_HAL_ERROR;
    }
    const fcsl_hal_status_t status =
        judge(external, external->wire.send(external->wire.ctx, sensors->bytes, sensors->size));
    return status == FCSL_HAL_OK ? judge(external, external->wire.send(external->wire.ctx, time.bytes, time.size))
                                 : status;
}

static void wait_anew(fcsl_external_t *external, uint32_t timeout_ms)
{
    external->deadline_ns = fcsl_monotonic_ns() + (uint64_t)timeout_ms * FCSL_NS_PER_MS;
    external->waits = 1;
}

/* The controller's run is over, or it began another one. */
static fcsl_hal_status_t controller_left(fcsl_external_t *external, handshake_kind_t kind, uint64_t tick)
{
    (void)snprintf(external->text, sizeof external->text, "the controller %s before actuator message of tick %" PRIu64,
                   kind == HANDSHAKE_END ? "ended its run" : "was started again", tick);
    return FCSL_HAL_CLOSED;
}

/* Looks at what came: OK when it is the message of `tick`, NONE when it counts for nothing, WAITING for a sign of life. */
static fcsl_hal_status_t check_message(fcsl_external_t *external, uint64_t tick, size_t size, fcsl_message_t *message)
{
    handshake_packet_t packet;
    const int is_control = handshake_parse(external->inbox, size, &packet) == 0;
    if (is_control && packet.kind == HANDSHAKE_HELLO && packet.flag) { /* another one, which runs free */
        external->messages_dropped++;
        return FCSL_HAL_NONE;
    }
    if (is_control && packet.kind != HANDSHAKE_REFUSAL) {
        return packet.kind == HANDSHAKE_KEEP_ALIVE ? FCSL_HAL_WAITING : controller_left(external, packet.kind, tick);
    }
    if (fcsl_message_check(&external->table, FCSL_ACTUATOR_MESSAGE, external->inbox, size, message) !=
            FCSL_MESSAGE_OK ||
        message->tick < tick) {
        external->messages_dropped++;
        return FCSL_HAL_NONE;
    }
    if (message->tick > tick) {
        (void)snprintf(external->text, sizeof external->text,
                       "actuator message of tick %" PRIu64 " came while tick %" PRIu64 " was due", message->tick, tick);
        return FCSL_HAL_ERROR;
    }
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t timed_out(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms)
{
    (void)snprintf(external->text, sizeof external->text,
                   "no actuator message of tick %" PRIu64 " within %" PRIu32 " ms (%" PRIu64
                   " malformed or late messages dropped)",
                   tick, timeout_ms, external->messages_dropped);
    return FCSL_HAL_TIMEOUT;
}

/* One wait: WAITING to go on with it. */
static fcsl_hal_status_t wait_once(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms,
                                   fcsl_message_t *message)
{
    size_t size = 0;
    const uint64_t begun_ns = fcsl_monotonic_ns();
    const fcsl_wire_status_t status = receive(external, external->deadline_ns, &size);
    if (status == FCSL_WIRE_ERROR) {
        return wire_failed(external);
    }
    if (status == FCSL_WIRE_CLOSED) {
        (void)snprintf(external->text, sizeof external->text,
                       "the controller went away before actuator message of tick %" PRIu64, tick);
        return FCSL_HAL_CLOSED;
    }
    if (status == FCSL_WIRE_NONE && is_early(begun_ns, external->deadline_ns)) {
        return FCSL_HAL_NONE;
    }
    const fcsl_hal_status_t seen =
        status == FCSL_WIRE_OK ? check_message(external, tick, size, message) : FCSL_HAL_NONE;
    if (seen == FCSL_HAL_WAITING) {
        wait_anew(external, timeout_ms);
    } else if (seen != FCSL_HAL_NONE) {
        return seen;
    }
    return fcsl_monotonic_ns() < external->deadline_ns ? FCSL_HAL_WAITING : timed_out(external, tick, timeout_ms);
}

fcsl_hal_status_t fcsl_external_await(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms,
                                      fcsl_message_t *message)
{
    if (!external->waits) {
        wait_anew(external, timeout_ms);
    }
    const fcsl_hal_status_t status = wait_once(external, tick, timeout_ms, message);
    external->waits = status == FCSL_HAL_WAITING;
    return status;
}

fcsl_hal_status_t fcsl_external_receive(fcsl_external_t *external, uint64_t tick, uint32_t timeout_ms,
                                        fcsl_message_t *message)
{
    fcsl_hal_status_t status = FCSL_HAL_WAITING;
    while (status == FCSL_HAL_WAITING) { /* ends at the time-out at the latest */
        status = fcsl_external_await(external, tick, timeout_ms, message);
    }
    return status;
}

void fcsl_external_keep_alive(fcsl_external_t *external)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (external->runs_free) {
        presence_send(&external->presence, &external->wire);
    } else if (now_ns >= external->keep_alive_ns) {
        external->keep_alive_ns = now_ns + HANDSHAKE_KEEP_ALIVE_NS;
        (void)handshake_send_keep_alive(&external->wire); /* the next one comes soon */
    }
}

/* ---- free-running ------------------------------------------------------------------------------------------------- */

static void count_take(fcsl_external_t *external, int taken)
{
    fcsl_external_counters_t *counters = &external->counters;
    external->ticks_without = taken ? 0u : external->ticks_without + 1u;
    counters->commands += taken ? 1u : 0u;
    counters->ticks_without += taken ? 0u : 1u;
    if (external->ticks_without > counters->longest_without) {
        counters->longest_without = external->ticks_without;
    }
}

fcsl_hal_status_t fcsl_external_take(fcsl_external_t *external, uint64_t tick, fcsl_message_t *message)
{
    int taken = 0;
    fcsl_external_keep_alive(external);
    for (int i = 0; i < MESSAGES_MAX && !taken; i++) { /* one message has all that came */
        size_t size = 0;
        const fcsl_wire_status_t status =
            external->wire.receive(external->wire.ctx, 0, external->inbox, external->inbox_size, &size);
        if (status == FCSL_WIRE_CLOSED) {
            presence_end(&external->presence);
        } else if (status != FCSL_WIRE_OK) {
            break;
        } else if (!presence_receive(&external->presence, external->inbox, size)) {
            taken = fcsl_message_check(&external->table, FCSL_ACTUATOR_MESSAGE, external->inbox, size, message) ==
                    FCSL_MESSAGE_OK;
            external->messages_dropped += taken ? 0u : 1u;
        }
    }
    message->tick = tick; /* the controller counts its own */
    count_take(external, taken);
    return taken ? FCSL_HAL_OK : FCSL_HAL_NONE;
}

int fcsl_external_runs_free(const fcsl_external_t *external)
{
    return external->runs_free;
}

int fcsl_external_read_log(fcsl_external_t *external, char text[FCSL_LOG_BYTES])
{
    return fcsl_log_read(&external->log, text);
}

fcsl_external_counters_t fcsl_external_counters(const fcsl_external_t *external)
{
    return external->counters;
}

/* ---- the end ------------------------------------------------------------------------------------------------------ */

void fcsl_external_end(fcsl_external_t *external, int another_follows)
{
    external->ended = 1;
    (void)handshake_send_end(&external->wire, another_follows); /* to nobody, when the controller is gone */
}

const char *fcsl_external_explain(const fcsl_external_t *external)
{
    return external->text;
}

uint64_t fcsl_external_messages_dropped(const fcsl_external_t *external)
{
    return external->messages_dropped;
}

void fcsl_external_close(fcsl_external_t *external)
{
    if (external == NULL) {
        return;
    }
    if (!external->ended) {
        fcsl_external_end(external, 0);
    }
    external->wire.close(external->wire.ctx);
    release(external);
}
