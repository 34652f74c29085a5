/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire of named values: sending, receiving, closing. One session sends all of a tick, the commit last, and messages of a
 * session keep their order: when a commit is there, so are its values.
 */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>

#include "transport/handshake.h"
#include "wire_named.h"
#include "wire_named_internal.h"

#define COUNTER(path, member, doc) FCSL_WIRE_COUNTER(named_counters_t, path, member, doc)

static const fcsl_field_t FIELDS[] = {
    COUNTER("bus.posted", bus.posted, "messages that the session took"),
    COUNTER("bus.refused", bus.refused, "messages for which there was no room"),
    COUNTER("bus.put", bus.put, "messages that were handed to Zenoh"),
    COUNTER("bus.put_failed", bus.put_failed, "messages that Zenoh refused"),
    COUNTER("bus.received", bus.received, "messages that came"),
    COUNTER("bus.replaced", bus.replaced, "values that a newer one replaced before they were taken"),
    COUNTER("bus.overflowed", bus.overflowed, "messages dropped because earlier ones were not read"),
    COUNTER("bus.wrong_size", bus.wrong_size, "messages dropped because they were too long or too short"),
    COUNTER("bus.deletions", bus.deletions, "deletions, which are no messages"),
    COUNTER("bus.strays", bus.strays, "messages under keys of the machine that no channel has"),
    COUNTER("bus.connects", bus.connects, "sessions that connected to this one"),
    COUNTER("bus.disconnects", bus.disconnects, "sessions that went"),
    COUNTER("bus.values_refused", values_refused, "values that their type, or their message, does not have"),
    COUNTER("bus.commits_refused", commits_refused,
            "commits and control packets that are none, or made for another machine"),
};

const fcsl_wire_counters_t fcsl_wire_named_counters = {
    .fields = FIELDS, .field_count = sizeof FIELDS / sizeof FIELDS[0], .bytes = sizeof(named_counters_t)};

static fcsl_wire_status_t named_send(void *ctx, const uint8_t *message, size_t size)
{
    named_wire_t *wire = ctx;
    if (!wire->runs_free && !bus_peer_lives(&wire->peer)) {
        return FCSL_WIRE_CLOSED;
    }
    return named_post(wire, message, size) == 0 ? FCSL_WIRE_OK : FCSL_WIRE_NONE;
}

/* The next message, if there is one. What a peer sent comes before the news that it is gone. */
static fcsl_wire_status_t take(void *ctx, uint8_t *bytes, size_t capacity, size_t *size)
{
    named_wire_t *wire = ctx;
    const int lives = bus_peer_lives(&wire->peer); /* looked at first: what it sent is there then */
    if (wire->time_follows) {
        return named_make_time(wire, bytes, capacity, size);
    }
    /* Looked at before commits: what the peer put before a control packet is there then. */
    if (wire->control_size == 0u) {
        (void)fcsl_bus_take(wire->peer.bus, NAMED_CONTROL, wire->control, &wire->control_size);
    }
    /* Who says hello hears already, whatever is known of it. */
    wire->peer.met = wire->peer.met || (lives && wire->control_size > 0u);
    if (bus_peer_meet(&wire->peer)) {
        const fcsl_wire_status_t status =
            wire->greeted ? named_take_commit(wire, bytes, capacity, size) : FCSL_WIRE_NONE;
        if (status != FCSL_WIRE_NONE) {
            return status;
        }
        if (wire->control_size > 0u && capacity >= HANDSHAKE_PACKET_MAX) {
            memcpy(bytes, wire->control, wire->control_size);
            *size = wire->control_size;
            wire->control_size = 0;
            wire->greeted = 1;
            return FCSL_WIRE_OK;
        }
    }
    const fcsl_wire_status_t status = lives ? FCSL_WIRE_NONE : bus_peer_disconnected(&wire->peer);
    if (status == FCSL_WIRE_CLOSED) {
        named_drain(wire, NAMED_COMMIT); /* a hello may be there of the next one */
    }
    return status;
}

/* Free-running: values come from anybody, control packets from a peer that lives. */
static fcsl_wire_status_t take_newest(void *ctx, uint8_t *bytes, size_t capacity, size_t *size)
{
    named_wire_t *wire = ctx;
    const int lives = bus_peer_lives(&wire->peer); /* looked at first: what it sent is there then */
    wire->peer.met = wire->peer.met || lives;
    if (capacity >= HANDSHAKE_PACKET_MAX && fcsl_bus_take(wire->peer.bus, NAMED_CONTROL, bytes, size) &&
        wire->peer.met) {
        return FCSL_WIRE_OK;
    }
    if (wire->peer.met && !lives) {
        wire->peer.met = 0;
        return FCSL_WIRE_CLOSED;
    }
    return named_take_newest(wire, bytes, capacity, size);
}

static fcsl_wire_status_t named_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity,
                                        size_t *size)
{
    named_wire_t *wire = ctx;
    return bus_peer_receive(&wire->peer, wire->runs_free ? take_newest : take, wire, deadline_ns, message, capacity,
                            size);
}

static const char *named_explain(void *ctx)
{
    return ((const named_wire_t *)ctx)->text;
}

static void named_count(void *ctx, void *values)
{
    const named_wire_t *wire = ctx;
    named_counters_t now = wire->counters;
    fcsl_bus_count(wire->peer.bus, &now.bus);
    now.commits_refused += now.bus.misfits;
    memcpy(values, &now, sizeof now);
}

void named_drain(named_wire_t *wire, uint32_t first)
{
    size_t size = 0;
    for (uint32_t i = first; i < wire->input_count; i++) {
        uint8_t *place = i == NAMED_CONTROL ? wire->control : wire->value;
        for (uint32_t n = 0; n < NAMED_WAITING_MAX && fcsl_bus_take(wire->peer.bus, i, place, &size); n++) {
        }
    }
    wire->control_size = first == NAMED_CONTROL ? 0u : wire->control_size;
    wire->greeted = 0;
    wire->time_follows = 0;
}

void named_free(named_wire_t *wire)
{
    free(wire->session.inputs);
    free((void *)wire->session.outputs);
    payload_close(&wire->payload);
    free(wire->control);
    free(wire->has_value);
    free(wire->numbers);
    free(wire->keys);
    free(wire->fresh);
    free(wire->image);
    free(wire->value);
    free(wire);
}

static void named_close(void *ctx)
{
    named_wire_t *wire = ctx;
    if (fcsl_bus_close(wire->peer.bus, NAMED_CLOSE_MS) == 0) { /* what Zenoh leaves behind ends with the program */
        named_free(wire);
    }
}

fcsl_wire_t named_functions(named_wire_t *wire)
{
    return (fcsl_wire_t){
        .ctx = wire,
        .send = named_send,
        .receive = named_receive,
        .explain = named_explain,
        .close = named_close,
        .counters = &fcsl_wire_named_counters,
        .count = named_count,
    };
}
