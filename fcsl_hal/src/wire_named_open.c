/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens the wire of named values: its keys, and the session.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "codec_layout.h"
#include "commit.h"
#include "control_packet.h"
#include "fcsl/fcsl_address.h"
#include "monotonic.h"
#include "wire_named_internal.h"

enum {
    COMMITS_WAITING = NAMED_WAITING_MAX,
    CONTROLS_WAITING = 4,
    TICKS_POSTED = 4, /* that the ring has room for */
    OTHER_KEYS = 5, /* than those of channels: control, commits, both tokens, all that there are */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside a message */
};

static int comes_in(const named_wire_t *wire, const fcsl_channel_t *channel)
{
    return (channel->direction == FCSL_SENSOR) == (wire->peer.side == FCSL_WIRE_CONNECT);
}

/* Bytes of the longest value under a channel's key. */
static size_t value_bytes(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    return channel->as == FCSL_AS_BLOB ? blob_capacity(field) : field->size;
}

static named_wire_t *allocate(const fcsl_channel_table_t *table, fcsl_wire_side_t side)
{
    const fcsl_machine_t *machine = table->machine;
    const uint32_t channels = machine->channel_count;
    named_wire_t *wire = calloc(1, sizeof *wire);
    if (wire == NULL) {
        return NULL;
    }
    wire->peer.side = side;
    wire->table = table;
    wire->value_bytes = commit_bytes(channels);
    for (uint32_t i = 0; i < channels; i++) {
        const size_t bytes = value_bytes(&machine->channels[i], &machine->fields[machine->channels[i].field]);
        wire->value_bytes = bytes > wire->value_bytes ? bytes : wire->value_bytes;
    }
    wire->numbers = calloc((size_t)channels + 1u, sizeof *wire->numbers);
    wire->keys = calloc((size_t)channels + OTHER_KEYS, FCSL_BUS_KEY_MAX + 1u);
    wire->fresh = calloc((size_t)channels + 1u, 1);
    wire->image = calloc(1, machine->size);
    wire->value = calloc(1, wire->value_bytes);
    wire->control = calloc(1, CONTROL_PACKET_MAX);
    if (wire->control == NULL || wire->numbers == NULL || wire->keys == NULL || wire->fresh == NULL ||
        wire->image == NULL || wire->value == NULL) {
        named_free(wire);
        return NULL;
    }
    return wire;
}

/* What a session is opened with. */
typedef struct {
    fcsl_bus_input_t *inputs;
    const char **outputs;
    uint32_t input_count;
    uint32_t output_count;
    const char *watched[2];
    const char *token;
    const char *strays;
    uint64_t tick_bytes; /* that are posted in a tick */
} plan_t;

/* Writes a key behind those that were written before. */
static const char *add_key(named_wire_t *wire, uint32_t *count, const char *name_space, const char *name)
{
    char *key = wire->keys + (size_t)(*count)++ * (FCSL_BUS_KEY_MAX + 1u);
    (void)snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%s%s%s/%s", name_space, name_space[0] != '\0' ? "/" : "",
                   wire->table->machine->name, name);
    return key;
}

static void fill_plan(named_wire_t *wire, const char *name_space, plan_t *plan)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const uint32_t commit_size = (uint32_t)commit_bytes(machine->channel_count);
    uint32_t keys = 0;
    const char *control = add_key(wire, &keys, name_space, "@control");
    const char *commit = add_key(wire, &keys, name_space, "tick");
    plan->watched[BUS_CONTROLLERS] = add_key(wire, &keys, name_space, "@controller");
    plan->watched[BUS_SIMULATORS] = add_key(wire, &keys, name_space, "@simulator");
    plan->strays = add_key(wire, &keys, name_space, "**");
    plan->token = plan->watched[wire->peer.side == FCSL_WIRE_LISTEN ? BUS_SIMULATORS : BUS_CONTROLLERS];
    plan->outputs[plan->output_count++] = control;
    plan->outputs[plan->output_count++] = commit;
    plan->inputs[plan->input_count++] =
        (fcsl_bus_input_t){.key = control, .bytes = CONTROL_PACKET_MAX, .depth = CONTROLS_WAITING};
    plan->inputs[plan->input_count++] =
        (fcsl_bus_input_t){.key = commit, .bytes = commit_size, .least = commit_size, .depth = COMMITS_WAITING};
    plan->tick_bytes = CONTROL_PACKET_MAX + commit_size + NAMED_CHANNELS * (uint64_t)ENTRY_BYTES_MAX;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const size_t bytes = value_bytes(channel, &machine->fields[channel->field]);
        const char *key = add_key(wire, &keys, name_space, channel->name);
        if (comes_in(wire, channel)) {
            wire->numbers[i] = plan->input_count;
            const uint32_t least = channel->as == FCSL_AS_BLOB ? 0u : (uint32_t)bytes;
            plan->inputs[plan->input_count++] =
                (fcsl_bus_input_t){.key = key, .bytes = (uint32_t)bytes, .least = least, .depth = 1, .quiet = 1};
        } else {
            wire->numbers[i] = plan->output_count;
            plan->outputs[plan->output_count++] = key;
            plan->tick_bytes += bytes + ENTRY_BYTES_MAX;
        }
    }
    wire->input_count = plan->input_count;
    wire->peer.output_count = NAMED_CHANNELS; /* a peer need not care for every channel */
}

/* Sets *endpoint to what is behind the kind, or null. */
static fcsl_bus_role_t role_of(const char *address, fcsl_wire_side_t side, const char **endpoint)
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
            *endpoint = address + length;
            return kinds[i].role;
        }
    }
    *endpoint = NULL;
    return FCSL_BUS_CLIENT;
}

static int open_session(named_wire_t *wire, const char *address, const plan_t *plan, uint64_t deadline_ns, char *error,
                        size_t error_size)
{
    const uint64_t now_ns = monotonic_ns();
    const char *endpoint = NULL;
    const fcsl_bus_role_t role = role_of(address, wire->peer.side, &endpoint);
    const fcsl_bus_options_t options = {
        .role = role,
        .endpoint = endpoint,
        .timeout_ms = deadline_ns > now_ns ? (uint32_t)((deadline_ns - now_ns) / NS_PER_MS) : 0u,
        .ring_bytes = (uint32_t)(TICKS_POSTED * plan->tick_bytes),
        .outputs = plan->outputs,
        .output_count = plan->output_count,
        .inputs = plan->inputs,
        .input_count = plan->input_count,
        .tokens = &plan->token,
        .token_count = 1,
        .watched = plan->watched,
        .strays = plan->strays,
        .watched_count = bus_peer_watched(wire->peer.side),
    };
    if (fcsl_bus_open(&options, &wire->peer.bus, error, error_size) != 0) {
        return -1;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT &&
        bus_peer_wait(&wire->peer, endpoint, deadline_ns, error, error_size) != 0) {
        (void)fcsl_bus_close(wire->peer.bus, NAMED_CLOSE_MS);
        return -1;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT) {
        named_drain(wire, NAMED_CONTROL); /* nothing of this controller's run comes before its hello */
    }
    return 0;
}

static int check(const char *name_space, const fcsl_machine_t *machine, char *error, size_t error_size)
{
    static const char LONGEST[] = "@controller"; /* of the names that are no channels */
    const size_t room = FCSL_BUS_KEY_MAX - 2u;
    if (strlen(name_space) + strlen(machine->name) + strlen(LONGEST) > room) {
        (void)snprintf(error, error_size, "the keys under namespace '%.100s' are longer than %u bytes", name_space,
                       FCSL_BUS_KEY_MAX);
        return -1;
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const char *name = machine->channels[i].name;
        if (strcmp(name, "tick") == 0) {
            (void)snprintf(error, error_size, "channel 'tick' cannot go over the bus: the commits have its key");
            return -1;
        }
        if (strlen(name_space) + strlen(machine->name) + strlen(name) > room) {
            (void)snprintf(error, error_size, "the key of channel '%.100s' is longer than %u bytes", name,
                           FCSL_BUS_KEY_MAX);
            return -1;
        }
    }
    return 0;
}

int fcsl_wire_check_named(const char *address, char *error, size_t error_size)
{
    static const char TCP[] = "tcp/";
    struct sockaddr_storage there;
    socklen_t length = 0;
    const char *endpoint = NULL;
    (void)role_of(address, FCSL_WIRE_CONNECT, &endpoint);
    if (endpoint == NULL || strncmp(endpoint, TCP, strlen(TCP)) != 0 ||
        fcsl_address_read(endpoint + strlen(TCP), &there, &length) != 0) {
        (void)snprintf(error, error_size, "%s: write zenoh:tcp/HOST:PORT in numbers, like zenoh:tcp/127.0.0.1:7447",
                       address);
        return -1;
    }
    return 0;
}

int fcsl_wire_open_named(const char *address, const char *name_space, const fcsl_channel_table_t *table,
                         fcsl_wire_side_t side, uint64_t deadline_ns, fcsl_wire_t *wire, char *error, size_t error_size)
{
    const uint32_t channels = table->machine->channel_count;
    if (fcsl_wire_check_named(address, error, error_size) != 0 ||
        check(name_space, table->machine, error, error_size) != 0) {
        return -1;
    }
    plan_t plan = {.inputs = calloc((size_t)channels + NAMED_CHANNELS, sizeof *plan.inputs),
                   .outputs = calloc((size_t)channels + NAMED_CHANNELS, sizeof *plan.outputs)};
    named_wire_t *self = allocate(table, side);
    int failed = -1;
    if (self == NULL || plan.inputs == NULL || plan.outputs == NULL) {
        (void)snprintf(error, error_size, "out of memory for the bus");
    } else {
        fill_plan(self, name_space, &plan);
        failed = open_session(self, address, &plan, deadline_ns, error, error_size) != 0 ? 1 : 0;
    }
    free(plan.inputs);
    free((void *)plan.outputs);
    if (failed) {
        if (self != NULL) {
            named_free(self);
        }
        return failed;
    }
    *wire = named_functions(self);
    return 0;
}
