/* SPDX-License-Identifier: Apache-2.0
 *
 * The HAL whose sensors and actuators are at the other end of a wire: a simulator that paces the run, or a rig.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_hal.h"
#include "named_values/wire_named.h"
#include "presence.h"
#include "transport/handshake.h"

enum {
    TEXT_BYTES = 512,
    SPEC_BYTES = 256,
    POLL_NS = 20 * FCSL_NS_PER_MS, /* a wait looks as often whether it is interrupted */
    MESSAGES_MAX = 4096 /* that a tick takes of a rig: more than a buffer holds */
};

/* How long a hello may be unanswered before another one is sent. */
static const uint64_t GREETING_NS = 5000000000u;

/* What stands under `hal.`; the wire's own counters follow it. */
typedef struct {
    uint64_t connected;
    uint64_t messages;
    uint64_t messages_dropped;
    uint64_t messages_late;
    uint64_t entries_skipped;
    uint64_t ticks_without;
    uint64_t commands;
    uint64_t commands_dropped;
    uint64_t armed;
    uint64_t wire[FCSL_WIRE_COUNTERS_MAX / sizeof(uint64_t)];
} counters_t;

#define COUNTER(member, doc) FCSL_WIRE_COUNTER(counters_t, #member, member, doc)

static const fcsl_field_t OWN_FIELDS[] = {
    COUNTER(connected, "1 while a peer is there"),
    COUNTER(messages, "sensor messages that were taken"),
    COUNTER(messages_dropped, "messages that were malformed, or made for another machine"),
    COUNTER(messages_late, "sensor messages of earlier ticks, or that a newer one replaced"),
    COUNTER(entries_skipped,
            "entries of taken messages that the channel table does not have, and quaternions of length zero"),
    COUNTER(ticks_without, "ticks since the last sensor message"),
    COUNTER(commands, "actuator messages that were sent"),
    COUNTER(commands_dropped, "actuator messages that the wire did not take"),
    COUNTER(armed, "1 while the commands are armed"),
};

enum { OWN_COUNT = sizeof OWN_FIELDS / sizeof OWN_FIELDS[0] };

typedef struct {
    fcsl_channel_table_t table;
    fcsl_wire_t wire;
    int has_wire;
    int greets; /* the hello was sent, and not answered yet */
    uint64_t greeted_ns; /* when; 0: nobody can answer any more */
    int is_over; /* the peer has ended the run, or is gone */
    int paces;
    int sensed;           /* the sensor message of the tick has come, and is kept in `sensors` */
    fcsl_message_t sensors;
    uint8_t *sensor_bytes;
    int waits;            /* for that tick, until deadline_ns */
    uint64_t deadline_ns;
    uint64_t keep_alive_ns;    /* when the next sign of life is due */
    uint32_t open_ms; /* how long it may take to find a peer */
    uint32_t timeout_ms;
    uint64_t time_ns; /* of the last time message */
    uint8_t *inbox;
    size_t inbox_size;
    fcsl_field_t *fields;
    counters_t counters;
    fcsl_log_t log;
    atomic_int interrupted;
    int is_named; /* `spec` is an address of the bus */
    int runs_free; /* such an address says so: nobody waits */
    presence_t presence; /* of a simulator that runs free, too */
    char spec[SPEC_BYTES];
    char name_space[SPEC_BYTES];
    char text[TEXT_BYTES];
} hal_t;

/* ---- receiving ----------------------------------------------------------------------------------------------------- */

typedef enum {
    RECEIVED_NOTHING, /* that counts */
    RECEIVED_SENSORS,
    RECEIVED_TIME,
    RECEIVED_KEEP_ALIVE,
    RECEIVED_END, /* of the run */
    RECEIVED_AGAIN /* the same, and another one follows */
} received_t;

/* What the `size` bytes in the inbox are. */
static received_t judge(hal_t *hal, size_t size, fcsl_message_t *message)
{
    handshake_packet_t packet;
    if (fcsl_message_check(&hal->table, FCSL_SENSOR_MESSAGE, hal->inbox, size, message) == FCSL_MESSAGE_OK) {
        return RECEIVED_SENSORS;
    }
    if (fcsl_message_check(&hal->table, FCSL_TIME_MESSAGE, hal->inbox, size, message) == FCSL_MESSAGE_OK) {
        return RECEIVED_TIME;
    }
    const int is_control = handshake_parse(hal->inbox, size, &packet) == 0;
    if (is_control && packet.kind == HANDSHAKE_END && !handshake_is_leave(&packet)) {
        hal->is_over = 1;
        return packet.flag ? RECEIVED_AGAIN : RECEIVED_END;
    }
    if (is_control && packet.kind == HANDSHAKE_KEEP_ALIVE) {
        return RECEIVED_KEEP_ALIVE;
    }
    hal->counters.messages_dropped++;
    return RECEIVED_NOTHING;
}

static fcsl_wire_status_t receive(hal_t *hal, uint64_t deadline_ns, size_t *size)
{
    return hal->wire.receive(hal->wire.ctx, deadline_ns, hal->inbox, hal->inbox_size, size);
}

/* Keeps a sensor message, which leaves the inbox. */
static void keep(hal_t *hal, const fcsl_message_t *received)
{
    hal->sensors = *received;
    memcpy(hal->sensor_bytes, received->bytes, received->size);
    hal->sensors.bytes = hal->sensor_bytes;
    hal->sensed = 1;
    hal->counters.messages++;
    hal->counters.entries_skipped += received->skipped;
    hal->counters.ticks_without = 0;
}

/* What was kept goes on; a tick without is counted. */
static void deliver(hal_t *hal, const fcsl_sink_t *to)
{
    hal->counters.ticks_without += hal->sensed ? 0u : 1u;
    if (hal->sensed) {
        to->sensed(to->ctx, &hal->sensors);
    }
}

/* ---- paced by a simulator ------------------------------------------------------------------------------------------ */

static fcsl_hal_status_t wire_failed(hal_t *hal)
{
    (void)snprintf(hal->text, sizeof hal->text, "%s", hal->wire.explain(hal->wire.ctx));
    return FCSL_HAL_ERROR;
}

static fcsl_hal_status_t too_early(hal_t *hal, const char *what, uint64_t came, uint64_t tick)
{
    (void)snprintf(hal->text, sizeof hal->text, "%s message of tick %" PRIu64 " came while tick %" PRIu64 " was due",
                   what, came, tick);
    return FCSL_HAL_ERROR;
}

static fcsl_hal_status_t timed_out(hal_t *hal, uint64_t tick)
{
    const uint64_t useless = hal->counters.messages_dropped + hal->counters.messages_late;
    (void)snprintf(hal->text, sizeof hal->text, "no time message of tick %" PRIu64 " within %" PRIu32 " ms", tick,
                   hal->timeout_ms);
    if (useless > 0) {
        const size_t length = strlen(hal->text);
        (void)snprintf(hal->text + length, sizeof hal->text - length,
                       " (%" PRIu64 " malformed or late messages dropped)", useless);
    }
    return FCSL_HAL_TIMEOUT;
}

/* The wire has nothing now, or never again: FCSL_HAL_WAITING to wait on. */
static fcsl_hal_status_t nothing_came(hal_t *hal, fcsl_wire_status_t status, uint64_t tick)
{
    if (atomic_load(&hal->interrupted)) {
        (void)snprintf(hal->text, sizeof hal->text, "interrupted while waiting for tick %" PRIu64, tick);
        return FCSL_HAL_CLOSED;
    }
    if (status == FCSL_WIRE_CLOSED) {
        hal->is_over = 1;
        hal->counters.connected = 0;
        (void)snprintf(hal->text, sizeof hal->text, "the simulator went away before tick %" PRIu64, tick);
        return FCSL_HAL_ERROR;
    }
    return status == FCSL_WIRE_ERROR ? wire_failed(hal) : FCSL_HAL_WAITING;
}

static void wait_anew(hal_t *hal)
{
    hal->deadline_ns = fcsl_monotonic_ns() + (uint64_t)hal->timeout_ms * FCSL_NS_PER_MS;
    hal->waits = 1;
}

/* Takes one message of the tick: WAITING to go on, OK when the tick happens now. */
static fcsl_hal_status_t take_message(hal_t *hal, uint64_t tick, size_t size)
{
    fcsl_message_t received;
    const received_t what = judge(hal, size, &received);
    if (what == RECEIVED_END || what == RECEIVED_AGAIN) {
        (void)snprintf(hal->text, sizeof hal->text, "the simulator ended the run at tick %" PRIu64, tick);
        return what == RECEIVED_END ? FCSL_HAL_CLOSED : FCSL_HAL_AGAIN;
    }
    if (what == RECEIVED_KEEP_ALIVE) {
        wait_anew(hal);
    }
    if (what == RECEIVED_NOTHING || what == RECEIVED_KEEP_ALIVE) {
        return FCSL_HAL_WAITING;
    }
    if (received.tick > tick) {
        return too_early(hal, what == RECEIVED_TIME ? "time" : "sensor", received.tick, tick);
    }
    if (received.tick < tick) {
        hal->counters.messages_late++;
        return FCSL_HAL_WAITING;
    }
    if (what == RECEIVED_SENSORS) {
        keep(hal, &received);
        return FCSL_HAL_WAITING;
    }
    hal->time_ns = received.time_ns;
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t sample_paced(hal_t *hal, uint64_t tick, const fcsl_sink_t *to)
{
    const uint64_t poll_ns = fcsl_monotonic_ns() + POLL_NS;
    fcsl_hal_status_t status = FCSL_HAL_WAITING;
    if (!hal->waits) {
        wait_anew(hal);
    }
    while (status == FCSL_HAL_WAITING) { /* every turn takes a message, or waits and looks at the time */
        size_t size = 0;
        const fcsl_wire_status_t came =
            atomic_load(&hal->interrupted)
                ? FCSL_WIRE_NONE
                : receive(hal, poll_ns < hal->deadline_ns ? poll_ns : hal->deadline_ns, &size);
        status = came == FCSL_WIRE_OK ? take_message(hal, tick, size) : nothing_came(hal, came, tick);
        if (status == FCSL_HAL_WAITING && fcsl_monotonic_ns() >= hal->deadline_ns) {
            status = timed_out(hal, tick);
        } else if (status == FCSL_HAL_WAITING && fcsl_monotonic_ns() >= poll_ns) {
            return FCSL_HAL_WAITING; /* what has been sensed is kept */
        }
    }
    hal->waits = 0;
    if (status == FCSL_HAL_OK) {
        deliver(hal, to);
    }
    hal->sensed = 0;
    return status;
}

/* A rig waits for nobody. */
static void wire_keep_alive(void *ctx)
{
    hal_t *hal = ctx;
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (hal->runs_free) {
        presence_send(&hal->presence, &hal->wire);
    } else if (hal->paces && now_ns >= hal->keep_alive_ns) {
        hal->keep_alive_ns = now_ns + HANDSHAKE_KEEP_ALIVE_NS;
        (void)handshake_send_keep_alive(&hal->wire); /* the next one comes soon */
    }
}

/* ---- beside a rig, or free-running ----------------------------------------------------------------------------------- */

static void rig_disconnected(hal_t *hal)
{
    if (hal->counters.connected != 0) {
        hal->counters.connected = 0;
        fcsl_log_write(&hal->log, "the rig is gone");
    }
}

/* What comes of a simulator that runs free, besides values: 1 where it was that. */
static int receive_presence(hal_t *hal, fcsl_wire_status_t came, size_t size)
{
    int received = 1;
    if (!hal->runs_free) {
        return 0;
    }
    if (came == FCSL_WIRE_CLOSED) {
        presence_end(&hal->presence);
    } else {
        received = came == FCSL_WIRE_OK && presence_receive(&hal->presence, hal->inbox, size);
    }
    hal->counters.connected = (uint64_t)hal->presence.there;
    return received;
}

/* Free-running, one message has all that came. */
static fcsl_hal_status_t sample_newest(hal_t *hal, uint64_t tick, const fcsl_sink_t *to)
{
    hal->sensed = 0;
    wire_keep_alive(hal);
    for (int i = 0; i < MESSAGES_MAX && !(hal->sensed && hal->runs_free); i++) {
        size_t size = 0;
        fcsl_message_t received;
        const fcsl_wire_status_t came = receive(hal, 0, &size);
        if (receive_presence(hal, came, size)) {
            continue;
        }
        if (came == FCSL_WIRE_CLOSED) {
            rig_disconnected(hal);
        }
        if (came != FCSL_WIRE_OK) {
            break;
        }
        const received_t what = judge(hal, size, &received);
        if (what == RECEIVED_END || what == RECEIVED_AGAIN) {
            rig_disconnected(hal);
        }
        if (what == RECEIVED_SENSORS) {
            hal->counters.messages_late += (uint64_t)hal->sensed;
            keep(hal, &received);
            hal->sensors.tick = tick; /* a rig counts its own */
        }
    }
    if (atomic_load(&hal->interrupted)) {
        return FCSL_HAL_CLOSED;
    }
    deliver(hal, to);
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t wire_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    hal_t *hal = ctx;
    return hal->paces ? sample_paced(hal, tick, to) : sample_newest(hal, tick, to);
}

/* ---- commands ------------------------------------------------------------------------------------------------------ */

/* The simulator may have ended the run after its last message: what it left is read. */
static fcsl_hal_status_t peer_disconnected(hal_t *hal, uint64_t tick)
{
    int ended = 0;
    int again = 0;
    for (int i = 0; i < MESSAGES_MAX && !ended; i++) {
        size_t size = 0;
        fcsl_message_t received;
        if (receive(hal, 0, &size) != FCSL_WIRE_OK) {
            break;
        }
        const received_t what = judge(hal, size, &received);
        ended = what == RECEIVED_END || what == RECEIVED_AGAIN;
        again = what == RECEIVED_AGAIN;
    }
    hal->counters.connected = (uint64_t)ended;
    (void)snprintf(hal->text, sizeof hal->text, "the simulator %s before actuator message of tick %" PRIu64,
                   ended ? "ended the run" : "went away", tick);
    return again ? FCSL_HAL_AGAIN : ended ? FCSL_HAL_CLOSED : FCSL_HAL_ERROR;
}

static fcsl_hal_status_t wire_command(void *ctx, const fcsl_message_t *message)
{
    hal_t *hal = ctx;
    const fcsl_wire_status_t status = hal->wire.send(hal->wire.ctx, message->bytes, message->size);
    if (status == FCSL_WIRE_OK) {
        hal->counters.commands++;
        return FCSL_HAL_OK;
    }
    hal->counters.commands_dropped++;
    if (!hal->paces) {
        return FCSL_HAL_OK; /* its gate closes when commands stay away */
    }
    if (status == FCSL_WIRE_CLOSED) {
        return peer_disconnected(hal, message->tick);
    }
    /* In lock-step no more than one message is under way: a full wire means that the peer is out of step. */
    if (status == FCSL_WIRE_NONE) {
        (void)snprintf(hal->text, sizeof hal->text, "the simulator does not take actuator message of tick %" PRIu64,
                       message->tick);
        return FCSL_HAL_ERROR;
    }
    return wire_failed(hal);
}

static fcsl_hal_status_t wire_arm(void *ctx, int armed)
{
    ((hal_t *)ctx)->counters.armed = armed != 0;
    return FCSL_HAL_OK;
}

/* ---- time, counters, end ------------------------------------------------------------------------------------------- */

static uint64_t wire_now_ns(void *ctx)
{
    const hal_t *hal = ctx;
    return hal->paces ? hal->time_ns : fcsl_monotonic_ns();
}

static void wire_wait(void *ctx, uint64_t until_ns)
{
    if (!((const hal_t *)ctx)->paces) {
        fcsl_monotonic_wait(until_ns);
    }
}

static void wire_count(void *ctx)
{
    hal_t *hal = ctx;
    if (hal->has_wire) {
        hal->wire.count(hal->wire.ctx, hal->counters.wire);
    }
}

static const char *wire_explain(void *ctx)
{
    return ((const hal_t *)ctx)->text;
}

static void wire_interrupt(void *ctx)
{
    atomic_store(&((hal_t *)ctx)->interrupted, 1);
}

static void wire_close(void *ctx)
{
    hal_t *hal = ctx;
    if (hal->has_wire) {
        if (!hal->is_over) {
            (void)handshake_send_leave(&hal->wire); /* where it finds no room, the peer waits for its time-out */
        }
        hal->wire.close(hal->wire.ctx);
    }
    free(hal->inbox);
    free(hal->sensor_bytes);
    free(hal->fields);
    free(hal);
}

/* ---- opening ------------------------------------------------------------------------------------------------------- */

/* Waits for the peer's answer to the hello. A rig may still send what was for a controller before this one. */
static int receive_hello(hal_t *hal, uint64_t deadline_ns, handshake_packet_t *packet, fcsl_error_t *error)
{
    fcsl_wire_status_t status = FCSL_WIRE_NONE;
    size_t size = 0;
    int answered = 0;
    while (!answered && status < FCSL_WIRE_CLOSED && fcsl_monotonic_ns() < deadline_ns &&
           !atomic_load(&hal->interrupted)) {
        const uint64_t poll_ns = fcsl_monotonic_ns() + POLL_NS;
        status = receive(hal, poll_ns < deadline_ns ? poll_ns : deadline_ns, &size);
        answered = status == FCSL_WIRE_OK && handshake_parse(hal->inbox, size, packet) == 0 &&
                   packet->kind <= HANDSHAKE_REFUSAL;
    }
    if (!answered && status < FCSL_WIRE_CLOSED) {
        (void)fcsl_fail(error, "no handshake from the simulator within %" PRIu32 " ms", hal->open_ms);
        return 1;
    }
    if (status == FCSL_WIRE_ERROR) {
        return fcsl_fail(error, "%s", hal->wire.explain(hal->wire.ctx));
    }
    if (!answered && hal->is_named) {
        (void)fcsl_fail(error, "the simulator on %s went away before it answered", hal->spec);
        hal->greeted_ns = 0;
        return 1;
    }
    if (!answered) {
        return fcsl_fail(error, "the other end of the wire did not answer as a simulator does");
    }
    return 0;
}

static int shake_hands(hal_t *hal, uint64_t deadline_ns, fcsl_error_t *error)
{
    handshake_packet_t packet;
    if (!hal->greets && handshake_send_hello(&hal->wire, &hal->table, 0) != FCSL_WIRE_OK) {
        return fcsl_fail(error, "cannot send the handshake: the other end is gone");
    }
    hal->greeted_ns = hal->greets ? hal->greeted_ns : fcsl_monotonic_ns();
    hal->greets = 1;
    const int failed = receive_hello(hal, deadline_ns, &packet, error);
    if (failed) {
        return failed;
    }
    hal->greets = 0;
    if (packet.kind == HANDSHAKE_REFUSAL) {
        return fcsl_fail(error, "the simulator refused: %s", packet.text);
    }
    hal->paces = packet.flag;
    if (hal->is_named && !hal->paces) {
        return fcsl_fail(error,
                         "the simulator on %s runs free: named values in lock-step need one that paces the run; write "
                         ",free-running behind this address, too",
                         hal->spec);
    }
    return handshake_differs(&packet, &hal->table, error->text, sizeof error->text) ? -1 : 0;
}

static int open_spec(hal_t *hal, uint64_t deadline_ns, fcsl_error_t *error)
{
    const size_t actuators = fcsl_message_capacity(hal->table.machine, FCSL_ACTUATOR_MESSAGE);
    fcsl_wire_t wire;
    const int failed = hal->is_named ? fcsl_wire_open_named(hal->spec, hal->name_space, &hal->table, FCSL_WIRE_CONNECT,
                                                            deadline_ns, &wire, error)
                                     : fcsl_wire_open(hal->spec, FCSL_WIRE_CONNECT,
                                                      actuators > hal->inbox_size ? actuators : hal->inbox_size,
                                                      hal->open_ms, &wire, error);
    if (failed) {
        return failed;
    }
    hal->wire = wire;
    hal->has_wire = 1;
    return 0;
}

/* A link that is cut takes a hello with it that was under way, and nobody tells: after a while a new session sends another one. */
static void begin_anew(hal_t *hal)
{
    if (hal->has_wire && hal->is_named && fcsl_monotonic_ns() - hal->greeted_ns > GREETING_NS) {
        hal->wire.close(hal->wire.ctx);
        hal->has_wire = 0;
        hal->greets = 0;
    }
}

static int wire_open(fcsl_hal_t *handle, fcsl_error_t *error)
{
    hal_t *hal = handle->ctx;
    const uint64_t deadline_ns = fcsl_monotonic_ns() + (uint64_t)hal->open_ms * FCSL_NS_PER_MS;
    int failed = hal->has_wire ? 0 : open_spec(hal, deadline_ns, error);
    if (hal->runs_free) {
        return failed;
    }
    failed = failed ? failed : shake_hands(hal, deadline_ns, error);
    if (failed > 0) {
        begin_anew(hal);
    }
    if (failed) {
        return failed;
    }
    hal->counters.connected = 1;
    handle->paces = hal->paces ? FCSL_PACED_BY_SIMULATOR : FCSL_PACED_BY_HOST;
    return 0;
}

/* The HAL's fields, and behind them those of the wire. */
static void fill_fields(hal_t *hal, const fcsl_wire_counters_t *of_wire)
{
    memcpy(hal->fields, OWN_FIELDS, sizeof OWN_FIELDS);
    for (uint32_t i = 0; i < of_wire->field_count; i++) {
        hal->fields[OWN_COUNT + i] = of_wire->fields[i];
        hal->fields[OWN_COUNT + i].offset += (uint32_t)offsetof(counters_t, wire);
    }
}

static int make(const fcsl_wire_counters_t *of_wire, const fcsl_machine_t *machine, uint32_t open_ms,
                uint32_t timeout_ms, fcsl_hal_t *handle, fcsl_error_t *error)
{
    const size_t sensors = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    hal_t *hal = calloc(1, sizeof *hal);
    if (hal != NULL) {
        hal->inbox_size = sensors > HANDSHAKE_PACKET_MAX ? sensors : HANDSHAKE_PACKET_MAX;
        hal->inbox = malloc(hal->inbox_size);
        hal->sensor_bytes = malloc(hal->inbox_size);
        hal->fields = calloc(OWN_COUNT + of_wire->field_count, sizeof *hal->fields);
    }
    if (hal == NULL || hal->inbox == NULL || hal->sensor_bytes == NULL || hal->fields == NULL ||
        of_wire->bytes > FCSL_WIRE_COUNTERS_MAX) {
        if (hal != NULL) {
            wire_close(hal);
        }
        return fcsl_fail(error, "out of memory for the wire, or it counts too much");
    }
    hal->table = fcsl_channel_table(machine);
    hal->open_ms = open_ms;
    hal->timeout_ms = timeout_ms;
    fill_fields(hal, of_wire);
    *handle = (fcsl_hal_t){
        .ctx = hal,
        .open = wire_open,
        .sample = wire_sample,
        .command = wire_command,
        .arm = wire_arm,
        .alive = wire_keep_alive,
        .clock = {.ctx = hal, .now_ns = wire_now_ns, .wait = wire_wait},
        .log = &hal->log,
        .count = wire_count,
        .explain = wire_explain,
        .interrupt = wire_interrupt,
        .close = wire_close,
        .fields = hal->fields,
        .field_count = OWN_COUNT + of_wire->field_count,
        .counters = &hal->counters,
        .counter_bytes = sizeof hal->counters,
        .serves = 1,
    };
    return 0;
}

int fcsl_hal_wire(const char *spec, const fcsl_machine_t *machine, uint32_t open_ms, uint32_t timeout_ms,
                  fcsl_hal_t *hal, fcsl_error_t *error)
{
    if (fcsl_wire_check(spec, error) != 0) {
        return -1;
    }
    if (strlen(spec) >= SPEC_BYTES) {
        return fcsl_fail(error, "the wire's name is too long: %d bytes are possible", SPEC_BYTES - 1);
    }
    if (make(fcsl_wire_counters(spec), machine, open_ms, timeout_ms, hal, error) != 0) {
        return -1;
    }
    (void)snprintf(((hal_t *)hal->ctx)->spec, SPEC_BYTES, "%s", spec);
    return 0;
}

int fcsl_hal_bus_check(const char *address, fcsl_error_t *error)
{
    return fcsl_wire_check_named(address, error);
}

int fcsl_hal_bus_runs_free(const char *address)
{
    return fcsl_wire_runs_free(address);
}

int fcsl_hal_bus(const char *address, const char *name_space, const fcsl_machine_t *machine, uint32_t open_ms,
                 uint32_t timeout_ms, fcsl_hal_t *hal, fcsl_error_t *error)
{
    if (fcsl_wire_check_named(address, error) != 0) {
        return -1;
    }
    if (strlen(address) >= SPEC_BYTES || strlen(name_space) >= SPEC_BYTES) {
        return fcsl_fail(error, "the address or the namespace is too long: %d bytes are possible", SPEC_BYTES - 1);
    }
    if (make(&fcsl_wire_named_counters, machine, open_ms, timeout_ms, hal, error) != 0) {
        return -1;
    }
    hal_t *self = hal->ctx;
    self->is_named = 1;
    self->runs_free = fcsl_wire_runs_free(address);
    self->presence = presence_of(FCSL_WIRE_LISTEN, &self->table, &self->log);
    (void)snprintf(self->spec, SPEC_BYTES, "%s", address);
    (void)snprintf(self->name_space, SPEC_BYTES, "%s", name_space);
    return 0;
}

int fcsl_hal_over_wire(const fcsl_wire_t *wire, const fcsl_machine_t *machine, uint32_t timeout_ms, fcsl_hal_t *hal,
                       fcsl_error_t *error)
{
    if (make(wire->counters, machine, timeout_ms, timeout_ms, hal, error) != 0) {
        return -1;
    }
    ((hal_t *)hal->ctx)->wire = *wire;
    ((hal_t *)hal->ctx)->has_wire = 1;
    return 0;
}
