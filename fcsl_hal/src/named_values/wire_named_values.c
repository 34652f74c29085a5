/* SPDX-License-Identifier: Apache-2.0
 *
 * Values of a tick and their commit: what a message of channels becomes on the bus, and what it is made of at the other end.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "codec/codec_layout.h"
#include "commit.h"
#include "fcsl/fcsl_tick_time.h"
#include "wire_named_internal.h"

/* ---- sending ---------------------------------------------------------------------------------------------------------- */

/* A value that its message cannot hold is not put: the other end keeps the one before. */
static int post_values(named_wire_t *wire, const fcsl_message_t *message)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const int64_t time_ns = (int64_t)fcsl_tick_time_ns(machine->tick_hz, message->tick);
    fcsl_message_entry_t entry = {0};
    uint32_t size = 0;
    int failed = 0;
    fcsl_message_apply(machine, wire->image, message);
    memset(wire->fresh, 0, machine->channel_count);
    while (!failed && fcsl_message_next(machine, message, &entry)) {
        if (payload_write(&wire->payload, entry.channel, wire->image, time_ns, wire->value, &size) != 0) {
            wire->counters.values_refused++;
            continue;
        }
        wire->fresh[entry.channel] = 1;
        failed = fcsl_bus_post(wire->peer.bus, wire->numbers[entry.channel], wire->value, size);
    }
    return failed;
}

static int post_commit(named_wire_t *wire, const commit_t *commit)
{
    const uint32_t channels = wire->table->machine->channel_count;
    commit_write(commit, wire->fresh, wire->value);
    return fcsl_bus_post(wire->peer.bus, NAMED_COMMIT, wire->value, commit_bytes(channels));
}

/* What the host sends was made by the codec, or by handshake.c: its first entry says what it is. */
int named_post(named_wire_t *wire, const uint8_t *bytes, size_t size)
{
    const uint32_t id = size >= 2 ? fcsl_get_u16(bytes) : 0u;
    commit_t commit = {.table_hash = wire->table->hash, .channels = (uint16_t)wire->table->machine->channel_count};
    if (id < SENSORS_ID || id > SENSORS_ID + FCSL_TIME_MESSAGE) {
        return fcsl_bus_post(wire->peer.bus, NAMED_CONTROL, bytes, size);
    }
    commit.tick = fcsl_get_u64(bytes + ENTRY_BYTES);
    fcsl_message_t message = {.bytes = bytes, .size = size, .tick = commit.tick};
    switch (id - SENSORS_ID) {
    case FCSL_SENSOR_MESSAGE: /* its time message follows, and with it the commit */
        message.kind = FCSL_SENSOR_MESSAGE;
        return post_values(wire, &message);
    case FCSL_TIME_MESSAGE:
        commit.direction = FCSL_SENSOR;
        commit.time_ns = fcsl_get_u64(bytes + EXTRA_AT + ENTRY_BYTES);
        return post_commit(wire, &commit);
    default:
        commit.direction = FCSL_ACTUATOR;
        commit.armed = bytes[EXTRA_AT + ENTRY_BYTES];
        message.kind = FCSL_ACTUATOR_MESSAGE;
        return post_values(wire, &message) != 0 ? -1 : post_commit(wire, &commit);
    }
}

/* ---- receiving -------------------------------------------------------------------------------------------------------- */

/* Takes the values of a commit: NONE when all came. */
static fcsl_wire_status_t take_values(named_wire_t *wire, const commit_t *commit)
{
    const fcsl_machine_t *machine = wire->table->machine;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        size_t size = 0;
        if (wire->fresh[i] == 0) {
            continue;
        }
        const int came = fcsl_bus_take(wire->peer.bus, wire->numbers[i], wire->value, &size);
        const int is_value = came && payload_read(&wire->payload, i, wire->value, size, wire->image) == 0;
        wire->counters.values_refused += came && !is_value;
        if (!is_value) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "the commit of tick %" PRIu64 " says that channel '%.100s' has a value, and %s",
                           commit->tick, machine->channels[i].name, came ? "what came is none" : "none came");
            return FCSL_WIRE_ERROR;
        }
    }
    return FCSL_WIRE_NONE;
}

/* The direction of what comes. */
static uint8_t theirs(const named_wire_t *wire)
{
    return wire->peer.side == FCSL_WIRE_LISTEN ? FCSL_ACTUATOR : FCSL_SENSOR;
}

/* Whether the commit in `value` is one of the peer's, of this machine and direction. */
static int read_commit(named_wire_t *wire, size_t size, commit_t *commit)
{
    const fcsl_machine_t *machine = wire->table->machine;
    int fits = commit_read(wire->value, size, machine->channel_count, commit, wire->fresh) == 0 &&
               commit->table_hash == wire->table->hash && commit->direction == theirs(wire);
    for (uint32_t i = 0; fits && i < machine->channel_count; i++) {
        fits = wire->fresh[i] == 0 || machine->channels[i].direction == theirs(wire);
    }
    wire->counters.commits_refused += fits ? 0u : 1u;
    return fits;
}

/* Makes of the values that came the message that the peer sent. */
static fcsl_wire_status_t make_message(named_wire_t *wire, const commit_t *commit, uint8_t *bytes, size_t capacity,
                                       size_t *size)
{
    fcsl_message_t message = {0};
    fcsl_message_status_t status = FCSL_MESSAGE_OK;
    if (commit->direction == FCSL_SENSOR) {
        status =
            fcsl_message_encode_sensors(wire->table, wire->image, commit->tick, wire->fresh, bytes, capacity, &message);
        wire->time_follows = status == FCSL_MESSAGE_OK;
        wire->tick = commit->tick;
        wire->time_ns = commit->time_ns;
    } else {
        status = fcsl_message_encode_actuators(wire->table, wire->image, commit->tick, commit->armed, bytes, capacity,
                                               &message);
    }
    if (status != FCSL_MESSAGE_OK) {
        (void)snprintf(wire->text, sizeof wire->text, "the values of tick %" PRIu64 ": %s", commit->tick,
                       fcsl_message_status_text(status));
        return FCSL_WIRE_ERROR;
    }
    *size = message.size;
    return FCSL_WIRE_OK;
}

fcsl_wire_status_t named_take_commit(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
{
    commit_t commit;
    size_t came = 0;
    /* All that wait, and may have been told at once: a refused one must not hide the next. */
    for (uint32_t n = 0; n < NAMED_WAITING_MAX && fcsl_bus_take(wire->peer.bus, NAMED_COMMIT, wire->value, &came);
         n++) {
        if (read_commit(wire, came, &commit)) {
            const fcsl_wire_status_t status = take_values(wire, &commit);
            return status == FCSL_WIRE_NONE ? make_message(wire, &commit, bytes, capacity, size) : status;
        }
    }
    return FCSL_WIRE_NONE;
}

/* Whether channels of what comes have values. */
typedef struct {
    int some; /* at least one has a new one */
    int all; /* each has one that came at some time */
} newest_t;

/* Free-running: looks at the commits that came. Returns 1 where one of them is the peer's, and *newest the last such one. */
static int take_newest_commit(named_wire_t *wire, commit_t *newest)
{
    commit_t commit;
    size_t size = 0;
    int found = 0;
    for (uint32_t n = 0; n < NAMED_WAITING_MAX && fcsl_bus_take(wire->peer.bus, NAMED_COMMIT, wire->value, &size);
         n++) {
        if (read_commit(wire, size, &commit)) {
            *newest = commit;
            found = 1;
        }
    }
    return found;
}

/* Free-running: stores the values that came, and marks them in `fresh`. */
static newest_t take_newest_values(named_wire_t *wire)
{
    const fcsl_machine_t *machine = wire->table->machine;
    newest_t newest = {.all = 1};
    memset(wire->fresh, 0, machine->channel_count);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        size_t size = 0;
        if (machine->channels[i].direction != theirs(wire)) {
            continue;
        }
        if (fcsl_bus_take(wire->peer.bus, wire->numbers[i], wire->value, &size)) {
            const int is_value = payload_read(&wire->payload, i, wire->value, size, wire->image) == 0;
            wire->counters.values_refused += is_value ? 0u : 1u;
            wire->fresh[i] = (uint8_t)is_value;
            wire->has_value[i] |= (uint8_t)is_value;
            newest.some = newest.some || is_value;
        }
        newest.all = newest.all && wire->has_value[i];
    }
    return newest;
}

fcsl_wire_status_t named_take_newest(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
{
    commit_t commit = {0};
    fcsl_message_t message;
    fcsl_message_status_t status = FCSL_MESSAGE_OK;
    const int committed = take_newest_commit(wire, &commit); /* first: its values are there then */
    const newest_t newest = take_newest_values(wire);
    if (wire->peer.side == FCSL_WIRE_CONNECT ? !newest.some : !newest.all || !committed) {
        return FCSL_WIRE_NONE;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT) {
        status = fcsl_message_encode_sensors(wire->table, wire->image, 0, wire->fresh, bytes, capacity, &message);
    } else {
        status = fcsl_message_encode_actuators(wire->table, wire->image, 0, commit.armed, bytes, capacity, &message);
    }
    if (status != FCSL_MESSAGE_OK) {
        (void)snprintf(wire->text, sizeof wire->text, "the values that came: %s", fcsl_message_status_text(status));
        return FCSL_WIRE_ERROR;
    }
    *size = message.size;
    return FCSL_WIRE_OK;
}

fcsl_wire_status_t named_make_time(named_wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
{
    fcsl_message_t message;
    wire->time_follows = 0;
    if (fcsl_message_encode_time(wire->table, wire->tick, wire->time_ns, bytes, capacity, &message) !=
        FCSL_MESSAGE_OK) {
        (void)snprintf(wire->text, sizeof wire->text, "no room for a time message");
        return FCSL_WIRE_ERROR;
    }
    *size = message.size;
    return FCSL_WIRE_OK;
}
