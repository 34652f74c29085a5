/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the wire of named values: its keys, and the session.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "codec/codec_layout.h"
#include "commit.h"
#include "bus/bus_config.h"
#include "name_space.h"
#include "transport/handshake.h"
#include "wire_named.h"
#include "wire_named_internal.h"

enum {
    COMMITS_WAITING = NAMED_WAITING_MAX,
    CONTROLS_WAITING = 4,
    TICKS_POSTED = 4, /* that the ring has room for */
    OTHER_KEYS = 5, /* than those of channels: control, commits, both tokens, all that there are */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside a message */
    CONNECT_MS = 500, /* of one of many tries */
};

static const char RUNS_FREE[] = ",free-running";

int fcsl_wire_runs_free(const char *address)
{
    const size_t length = strlen(address);
    const size_t behind = strlen(RUNS_FREE);
    return length >= behind && strcmp(address + length - behind, RUNS_FREE) == 0;
}

static int comes_in(const named_wire_t *wire, const fcsl_channel_t *channel)
{
    return channel->direction == (wire->peer.side == FCSL_WIRE_CONNECT ? FCSL_SENSOR : FCSL_ACTUATOR);
}

static named_wire_t *allocate(const fcsl_channel_table_t *table, fcsl_wire_side_t side, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = table->machine;
    const uint32_t channels = machine->channel_count;
    named_wire_t *wire = calloc(1, sizeof *wire);
    (void)fcsl_fail(error, "out of memory for the bus");
    if (wire == NULL) {
        return NULL;
    }
    wire->peer.side = side;
    wire->table = table;
    wire->value_bytes = commit_bytes(channels);
    for (uint32_t i = 0; i < channels; i++) {
        const size_t bytes = payload_most(machine, i);
        wire->value_bytes = bytes > wire->value_bytes ? bytes : wire->value_bytes;
    }
    wire->numbers = calloc((size_t)channels + 1u, sizeof *wire->numbers);
    wire->keys = calloc((size_t)channels + OTHER_KEYS, FCSL_BUS_KEY_MAX + 1u);
    wire->fresh = calloc((size_t)channels + 1u, 1);
    wire->image = calloc(1, machine->size);
    wire->value = calloc(1, wire->value_bytes);
    wire->has_value = calloc((size_t)channels + 1u, 1);
    wire->control = calloc(1, HANDSHAKE_PACKET_MAX);
    wire->session.inputs = calloc((size_t)channels + NAMED_CHANNELS, sizeof *wire->session.inputs);
    wire->session.outputs = calloc((size_t)channels + NAMED_CHANNELS, sizeof *wire->session.outputs);
    if (wire->session.inputs == NULL || wire->session.outputs == NULL || wire->has_value == NULL ||
        wire->control == NULL || wire->numbers == NULL || wire->keys == NULL || wire->fresh == NULL ||
        wire->image == NULL || wire->value == NULL || payload_open(&wire->payload, machine, error) != 0) {
        named_free(wire);
        return NULL;
    }
    return wire;
}

/* Writes a key behind those that were written before. */
static const char *add_key(named_wire_t *wire, uint32_t *count, const char *name_space, const char *name)
{
    char *key = wire->keys + (size_t)(*count)++ * (FCSL_BUS_KEY_MAX + 1u);
    const int length = name_space_trim(&name_space);
    (void)snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%.*s%s%s/%s", length, name_space, length > 0 ? "/" : "",
                   wire->table->machine->name, name);
    return key;
}

static void fill_session(named_wire_t *wire, const char *name_space)
{
    named_session_t *session = &wire->session;
    const fcsl_machine_t *machine = wire->table->machine;
    const uint32_t commit_size = (uint32_t)commit_bytes(machine->channel_count);
    const uint8_t theirs = wire->peer.side == FCSL_WIRE_LISTEN ? FCSL_ACTUATOR : FCSL_SENSOR;
    uint32_t keys = 0;
    const char *control = add_key(wire, &keys, name_space, "@control");
    const char *commit = add_key(wire, &keys, name_space, "tick");
    session->watched[BUS_CONTROLLERS] = add_key(wire, &keys, name_space, "@controller");
    session->watched[BUS_SIMULATORS] = add_key(wire, &keys, name_space, "@simulator");
    session->strays = add_key(wire, &keys, name_space, "**");
    session->token = session->watched[wire->peer.side == FCSL_WIRE_LISTEN ? BUS_SIMULATORS : BUS_CONTROLLERS];
    session->outputs[session->output_count++] = control;
    session->outputs[session->output_count++] = commit;
    session->inputs[session->input_count++] = (fcsl_bus_input_t){
        .key = control, .bytes = HANDSHAKE_PACKET_MAX, .depth = CONTROLS_WAITING, .fits = handshake_fits};
    session->inputs[session->input_count++] = (fcsl_bus_input_t){.key = commit,
                                                                 .bytes = commit_size,
                                                                 .least = commit_size,
                                                                 .depth = wire->runs_free ? 1u : COMMITS_WAITING,
                                                                 .fits = commit_fits,
                                                                 .what = (uint64_t)theirs << 32 | wire->table->hash};
    session->tick_bytes = HANDSHAKE_PACKET_MAX + commit_size + NAMED_CHANNELS * (uint64_t)ENTRY_BYTES_MAX;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const char *key = add_key(wire, &keys, name_space, channel->name);
        if (comes_in(wire, channel)) {
            wire->numbers[i] = session->input_count;
            session->inputs[session->input_count++] = (fcsl_bus_input_t){.key = key,
                                                                         .bytes = payload_most(machine, i),
                                                                         .least = payload_least(machine, i),
                                                                         .depth = 1,
                                                                         .quiet = 1};
        } else {
            wire->numbers[i] = session->output_count;
            session->outputs[session->output_count++] = key;
            session->tick_bytes += payload_bytes(machine, i) + ENTRY_BYTES_MAX;
        }
    }
    wire->input_count = session->input_count;
    wire->peer.output_count = NAMED_CHANNELS; /* a peer need not care for every channel */
}

/* Copies what is behind the kind, without ,free-running; "" where there is no such kind. */
static fcsl_bus_role_t role_of(const char *address, fcsl_wire_side_t side, char endpoint[NAMED_ENDPOINT_BYTES])
{
    const struct {
        const char *kind;
        fcsl_bus_role_t role;
    } kinds[] = {{"zenoh:", side == FCSL_WIRE_LISTEN ? FCSL_BUS_LISTEN : FCSL_BUS_CLIENT},
                 {"zenoh-client:", FCSL_BUS_CLIENT},
                 {"zenoh-peer:", FCSL_BUS_PEER}};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        const size_t length = strlen(kinds[i].kind);
        if (strncmp(address, kinds[i].kind, length) == 0) {
            const size_t behind = fcsl_wire_runs_free(address) ? strlen(RUNS_FREE) : 0u;
            (void)snprintf(endpoint, NAMED_ENDPOINT_BYTES, "%.*s", (int)(strlen(address) - length - behind),
                           address + length);
            return kinds[i].role;
        }
    }
    endpoint[0] = '\0';
    return FCSL_BUS_CLIENT;
}

static int open_session(named_wire_t *wire, const char *address, uint64_t deadline_ns, fcsl_error_t *error)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    const uint32_t wait_ms = deadline_ns > now_ns ? (uint32_t)((deadline_ns - now_ns) / FCSL_NS_PER_MS) : 0u;
    named_session_t *session = &wire->session;
    const fcsl_bus_role_t role = role_of(address, wire->peer.side, session->endpoint);
    const fcsl_bus_options_t options = {
        .role = role,
        .endpoint = session->endpoint,
        .timeout_ms = wire->runs_free ? CONNECT_MS : wait_ms,
        .connects_later = wire->runs_free,
        .observer = wire->runs_free, /* who reads slowly gets the newest later, and holds up nobody */
        .ring_bytes = (uint32_t)(TICKS_POSTED * session->tick_bytes),
        .outputs = session->outputs,
        .output_count = session->output_count,
        .inputs = session->inputs,
        .input_count = session->input_count,
        .tokens = &session->token,
        .token_count = 1,
        .watched = session->watched,
        .strays = session->strays,
        .watched_count = bus_peer_watched(wire->peer.side),
    };
    if (fcsl_bus_open(&options, &wire->peer.bus, error) != 0) {
        return -1;
    }
    if (wire->runs_free) {
        return 0;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT &&
        bus_peer_wait(&wire->peer, session->endpoint, deadline_ns, error) != 0) {
        (void)fcsl_bus_close(wire->peer.bus, NAMED_CLOSE_MS);
        return -1;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT) {
        named_drain(wire, NAMED_CONTROL); /* nothing of this controller's run comes before its hello */
    }
    return 0;
}

static int check(const char *name_space, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    static const char LONGEST[] = "@controller"; /* of the names that are no channels */
    const size_t room = FCSL_BUS_KEY_MAX - 2u;
    if (strlen(name_space) + strlen(machine->name) + strlen(LONGEST) > room) {
        return fcsl_fail(error, "the keys under namespace '%.100s' are longer than %u bytes", name_space,
                         FCSL_BUS_KEY_MAX);
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const char *name = machine->channels[i].name;
        if (strcmp(name, "tick") == 0) {
            return fcsl_fail(error, "channel 'tick' cannot go over the bus: the commits have its key");
        }
        if (strlen(name_space) + strlen(machine->name) + strlen(name) > room) {
            return fcsl_fail(error, "the key of channel '%.100s' is longer than %u bytes", name, FCSL_BUS_KEY_MAX);
        }
    }
    return 0;
}

int fcsl_wire_check_named(const char *address, fcsl_error_t *error)
{
    struct sockaddr_storage there;
    socklen_t length = 0;
    char endpoint[NAMED_ENDPOINT_BYTES];
    (void)role_of(address, FCSL_WIRE_CONNECT, endpoint);
    if (fcsl_bus_endpoint_read(endpoint, &there, &length) != 0) {
        return fcsl_fail(
            error,
            "%s: write zenoh:tcp:HOST:PORT in numbers, like zenoh:tcp:127.0.0.1:7447, and ,free-running behind it "
            "where nobody waits for the other",
            address);
    }
    return 0;
}

int fcsl_wire_open_named(const char *address, const char *name_space, const fcsl_channel_table_t *table,
                         fcsl_wire_side_t side, uint64_t deadline_ns, fcsl_wire_t *wire, fcsl_error_t *error)
{
    if (fcsl_wire_check_named(address, error) != 0 || check(name_space, table->machine, error) != 0) {
        return -1;
    }
    named_wire_t *self = allocate(table, side, error);
    if (self == NULL) {
        return -1;
    }
    self->runs_free = fcsl_wire_runs_free(address);
    fill_session(self, name_space);
    if (open_session(self, address, deadline_ns, error) != 0) {
        named_free(self);
        return 1;
    }
    *wire = named_functions(self);
    return 0;
}
