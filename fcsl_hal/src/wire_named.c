/* SPDX-License-Identifier: Apache-2.0
 *
 * The wire of named values. One session sends all of a tick, the commit last, and messages of a session keep their order: when a
 * commit is there, so are its values.
 */
#define _GNU_SOURCE
#include "wire_named.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bus_peer.h"
#include "codec_layout.h"
#include "commit.h"
#include "control_packet.h"
#include "fcsl/fcsl_address.h"
#include "monotonic.h"

enum {
    COMMITS_WAITING = 8,
    CONTROLS_WAITING = 4,
    TICKS_POSTED = 4, /* that the ring has room for */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside a message */
    CLOSE_MS = 2000, /* for the peer to take what was sent last */
    TIME_MESSAGE_BYTES = 64,
    TEXT_BYTES = 256
};

/* Inputs and outputs of both ends; behind them the channels that come, and those that go. */
enum { CONTROL = 0, COMMIT = 1, FIRST_CHANNEL = 2 };

typedef struct {
    fcsl_bus_counters_t bus;
    uint64_t values_refused;
    uint64_t commits_refused;
} counters_t;

#define COUNTER(path, member, doc) FCSL_WIRE_COUNTER(counters_t, path, member, doc)

static const fcsl_field_t FIELDS[] = {
    COUNTER("bus.posted", bus.posted, "messages that the session took"),
    COUNTER("bus.refused", bus.refused, "messages for which there was no room"),
    COUNTER("bus.put", bus.put, "messages that were handed to Zenoh"),
    COUNTER("bus.put_failed", bus.put_failed, "messages that Zenoh refused"),
    COUNTER("bus.received", bus.received, "messages that came"),
    COUNTER("bus.overflowed", bus.overflowed, "messages dropped because earlier ones were not read"),
    COUNTER("bus.too_large", bus.too_large, "messages dropped because they were too long"),
    COUNTER("bus.deletions", bus.deletions, "deletions, which are no messages"),
    COUNTER("bus.strays", bus.strays, "messages under keys of the machine that no channel has"),
    COUNTER("bus.connects", bus.connects, "sessions that connected to this one"),
    COUNTER("bus.disconnects", bus.disconnects, "sessions that went"),
    COUNTER("bus.values_refused", values_refused, "values of a wrong size, or that their type does not have"),
    COUNTER("bus.commits_refused", commits_refused, "commits that are none, or made for another machine"),
};

const fcsl_wire_counters_t fcsl_wire_named_counters = {
    .fields = FIELDS, .field_count = sizeof FIELDS / sizeof FIELDS[0], .bytes = sizeof(counters_t)};

typedef struct {
    bus_peer_t peer;
    const fcsl_channel_table_t *table;
    uint32_t *numbers; /* of each channel: its input or output */
    char *keys;        /* FCSL_BUS_KEY_MAX + 1 bytes each: those of the channels, and the five others */
    uint8_t *fresh;    /* of each channel: has a value in the tick */
    uint8_t *image;    /* a struct of the machine: the values that came last */
    uint8_t *value;    /* the longest of a channel, or a commit */
    size_t value_bytes;
    uint64_t time_ns; /* of the tick, for its time message */
    uint64_t tick;
    int greeted;      /* the peer's first control packet was taken: what it put before is not looked at */
    int time_follows; /* the sensor message was handed on, and its time message was not */
    counters_t counters;
    char text[TEXT_BYTES];
} wire_t;

static int comes_in(const wire_t *wire, const fcsl_channel_t *channel)
{
    return (channel->direction == FCSL_SENSOR) == (wire->peer.side == FCSL_WIRE_CONNECT);
}

/* ---- sending ---------------------------------------------------------------------------------------------------------- */

static int post_values(wire_t *wire, const uint8_t *bytes, size_t size, fcsl_message_kind_t kind)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const fcsl_message_t message = {.bytes = bytes, .size = size, .kind = kind};
    fcsl_message_entry_t entry = {0};
    int failed = 0;
    memset(wire->fresh, 0, machine->channel_count);
    while (!failed && fcsl_message_next(machine, &message, &entry)) {
        wire->fresh[entry.channel] = 1;
        failed = fcsl_bus_post(wire->peer.bus, wire->numbers[entry.channel], entry.values, entry.size);
    }
    return failed;
}

static int post_commit(wire_t *wire, const commit_t *commit)
{
    const uint32_t channels = wire->table->machine->channel_count;
    commit_write(commit, wire->fresh, wire->value);
    return fcsl_bus_post(wire->peer.bus, COMMIT, wire->value, commit_bytes(channels));
}

/* What the host sends was made by the codec, or by control_packet.c: its first entry says what it is. */
static int post(wire_t *wire, const uint8_t *bytes, size_t size)
{
    const uint32_t id = size >= 2 ? fcsl_get_u16(bytes) : 0u;
    commit_t commit = {.table_hash = wire->table->hash, .channels = (uint16_t)wire->table->machine->channel_count};
    if (id < SENSORS_ID || id > SENSORS_ID + FCSL_TIME_MESSAGE) {
        return fcsl_bus_post(wire->peer.bus, CONTROL, bytes, size);
    }
    commit.tick = fcsl_get_u64(bytes + ENTRY_BYTES);
    switch (id - SENSORS_ID) {
    case FCSL_SENSOR_MESSAGE: /* its time message follows, and with it the commit */
        return post_values(wire, bytes, size, FCSL_SENSOR_MESSAGE);
    case FCSL_TIME_MESSAGE:
        commit.direction = FCSL_SENSOR;
        commit.time_ns = fcsl_get_u64(bytes + EXTRA_AT + ENTRY_BYTES);
        return post_commit(wire, &commit);
    default:
        commit.direction = FCSL_ACTUATOR;
        commit.armed = bytes[EXTRA_AT + ENTRY_BYTES];
        return post_values(wire, bytes, size, FCSL_ACTUATOR_MESSAGE) != 0 ? -1 : post_commit(wire, &commit);
    }
}

static fcsl_wire_status_t named_send(void *ctx, const uint8_t *message, size_t size)
{
    wire_t *wire = ctx;
    if (!bus_peer_lives(&wire->peer)) {
        return FCSL_WIRE_CLOSED;
    }
    return post(wire, message, size) == 0 ? FCSL_WIRE_OK : FCSL_WIRE_NONE;
}

/* ---- receiving -------------------------------------------------------------------------------------------------------- */

/* Stores the value of a channel. Returns 1, or 0 where it is none. */
static int store_value(wire_t *wire, const fcsl_channel_t *channel, size_t size)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const fcsl_field_t *field = &machine->fields[channel->field];
    uint8_t *place = wire->image + field->offset;
    if (channel->as == FCSL_AS_BLOB && size <= blob_capacity(field)) {
        blob_import(place, wire->value, (uint32_t)size, blob_capacity(field));
        return 1;
    }
    if (channel->as == FCSL_AS_BLOB || size != field->size ||
        !fcsl_scalars_valid(machine, wire->value, field->type, field->count)) {
        wire->counters.values_refused++;
        return 0;
    }
    fcsl_scalars_import(place, wire->value, field->type, field->count);
    return 1;
}

/* Takes the values of a commit: NONE when all came. */
static fcsl_wire_status_t take_values(wire_t *wire, const commit_t *commit)
{
    const fcsl_machine_t *machine = wire->table->machine;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        size_t size = 0;
        if (wire->fresh[i] == 0) {
            continue;
        }
        const int came = fcsl_bus_take(wire->peer.bus, wire->numbers[i], wire->value, &size);
        if (!came || !store_value(wire, &machine->channels[i], size)) {
            (void)snprintf(wire->text, sizeof wire->text,
                           "the commit of tick %" PRIu64 " says that channel '%.100s' has a value, and %s",
                           commit->tick, machine->channels[i].name, came ? "what came is none" : "none came");
            return FCSL_WIRE_ERROR;
        }
    }
    return FCSL_WIRE_NONE;
}

/* Whether the commit in `value` is one of the peer's, of this machine and direction. */
static int read_commit(wire_t *wire, size_t size, commit_t *commit)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const uint8_t theirs = wire->peer.side == FCSL_WIRE_LISTEN ? FCSL_ACTUATOR : FCSL_SENSOR;
    int fits = commit_read(wire->value, size, machine->channel_count, commit, wire->fresh) == 0 &&
               commit->table_hash == wire->table->hash && commit->direction == theirs;
    for (uint32_t i = 0; fits && i < machine->channel_count; i++) {
        fits = wire->fresh[i] == 0 || machine->channels[i].direction == theirs;
    }
    wire->counters.commits_refused += fits ? 0u : 1u;
    return fits;
}

/* Makes of the values that came the message that the peer sent. */
static fcsl_wire_status_t make_message(wire_t *wire, const commit_t *commit, uint8_t *bytes, size_t capacity,
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

static fcsl_wire_status_t take_commit(wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
{
    commit_t commit;
    size_t came = 0;
    if (!fcsl_bus_take(wire->peer.bus, COMMIT, wire->value, &came) || !read_commit(wire, came, &commit)) {
        return FCSL_WIRE_NONE;
    }
    const fcsl_wire_status_t status = take_values(wire, &commit);
    return status == FCSL_WIRE_NONE ? make_message(wire, &commit, bytes, capacity, size) : status;
}

static fcsl_wire_status_t make_time(wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
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

/* The next message, if there is one. What a peer sent comes before the news that it is gone. */
static fcsl_wire_status_t take(wire_t *wire, uint8_t *bytes, size_t capacity, size_t *size)
{
    const int lives = bus_peer_lives(&wire->peer); /* looked at first: what it sent is there then */
    if (wire->time_follows) {
        return make_time(wire, bytes, capacity, size);
    }
    if (bus_peer_meet(&wire->peer)) {
        /* Peers begin and end with a control packet: between the two keys that is their order. */
        const fcsl_wire_status_t status = wire->greeted ? take_commit(wire, bytes, capacity, size) : FCSL_WIRE_NONE;
        if (status != FCSL_WIRE_NONE) {
            return status;
        }
        if (capacity >= CONTROL_PACKET_MAX && fcsl_bus_take(wire->peer.bus, CONTROL, bytes, size)) {
            wire->greeted = 1;
            return FCSL_WIRE_OK;
        }
    }
    const fcsl_wire_status_t gone = lives ? FCSL_WIRE_NONE : bus_peer_gone(&wire->peer);
    wire->greeted = wire->greeted && wire->peer.met;
    return gone;
}

static fcsl_wire_status_t named_receive(void *ctx, uint64_t deadline_ns, uint8_t *message, size_t capacity,
                                        size_t *size)
{
    wire_t *wire = ctx;
    for (;;) { /* ends at the deadline, whatever arrives */
        const fcsl_wire_status_t status = take(wire, message, capacity, size);
        if (status != FCSL_WIRE_NONE || monotonic_ns() >= deadline_ns) {
            return status;
        }
        if (!fcsl_bus_wait(wire->peer.bus, deadline_ns) && monotonic_ns() < deadline_ns) {
            return FCSL_WIRE_NONE; /* a signal */
        }
    }
}

static const char *named_explain(void *ctx)
{
    return ((const wire_t *)ctx)->text;
}

static void named_count(void *ctx, void *values)
{
    wire_t *wire = ctx;
    fcsl_bus_count(wire->peer.bus, &wire->counters.bus);
    memcpy(values, &wire->counters, sizeof wire->counters);
}

static void release(wire_t *wire)
{
    free(wire->numbers);
    free(wire->keys);
    free(wire->fresh);
    free(wire->image);
    free(wire->value);
    free(wire);
}

static void named_close(void *ctx)
{
    wire_t *wire = ctx;
    (void)fcsl_bus_close(wire->peer.bus, CLOSE_MS); /* what Zenoh leaves behind ends with the program */
    release(wire);
}

/* ---- opening ---------------------------------------------------------------------------------------------------------- */

/* Bytes of the longest value under a channel's key. */
static size_t value_bytes(const fcsl_channel_t *channel, const fcsl_field_t *field)
{
    return channel->as == FCSL_AS_BLOB ? blob_capacity(field) : field->size;
}

static wire_t *allocate(const fcsl_channel_table_t *table, fcsl_wire_side_t side)
{
    const fcsl_machine_t *machine = table->machine;
    const uint32_t channels = machine->channel_count;
    wire_t *wire = calloc(1, sizeof *wire);
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
    wire->keys = calloc((size_t)channels + 5u, FCSL_BUS_KEY_MAX + 1u);
    wire->fresh = calloc((size_t)channels + 1u, 1);
    wire->image = calloc(1, machine->size);
    wire->value = calloc(1, wire->value_bytes);
    if (wire->numbers == NULL || wire->keys == NULL || wire->fresh == NULL || wire->image == NULL ||
        wire->value == NULL) {
        release(wire);
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
    uint64_t tick_bytes; /* that are posted in a tick */
} plan_t;

/* Writes a key behind those that were written before. */
static const char *add_key(wire_t *wire, uint32_t *count, const char *name_space, const char *name)
{
    char *key = wire->keys + (size_t)(*count)++ * (FCSL_BUS_KEY_MAX + 1u);
    (void)snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%s%s%s/%s", name_space, name_space[0] != '\0' ? "/" : "",
                   wire->table->machine->name, name);
    return key;
}

static void fill_plan(wire_t *wire, const char *name_space, plan_t *plan)
{
    const fcsl_machine_t *machine = wire->table->machine;
    const uint32_t commit_size = (uint32_t)commit_bytes(machine->channel_count);
    uint32_t keys = 0;
    const char *control = add_key(wire, &keys, name_space, "@control");
    const char *commit = add_key(wire, &keys, name_space, "tick");
    plan->watched[BUS_CONTROLLERS] = add_key(wire, &keys, name_space, "@controller");
    plan->watched[BUS_SIMULATORS] = add_key(wire, &keys, name_space, "@simulator");
    plan->token = plan->watched[wire->peer.side == FCSL_WIRE_LISTEN ? BUS_SIMULATORS : BUS_CONTROLLERS];
    plan->outputs[plan->output_count++] = control;
    plan->outputs[plan->output_count++] = commit;
    plan->inputs[plan->input_count++] =
        (fcsl_bus_input_t){.key = control, .bytes = CONTROL_PACKET_MAX, .depth = CONTROLS_WAITING};
    plan->inputs[plan->input_count++] =
        (fcsl_bus_input_t){.key = commit, .bytes = commit_size, .depth = COMMITS_WAITING};
    plan->tick_bytes = CONTROL_PACKET_MAX + commit_size + FIRST_CHANNEL * (uint64_t)ENTRY_BYTES_MAX;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const size_t bytes = value_bytes(channel, &machine->fields[channel->field]);
        const char *key = add_key(wire, &keys, name_space, channel->name);
        if (comes_in(wire, channel)) {
            wire->numbers[i] = plan->input_count;
            plan->inputs[plan->input_count++] = (fcsl_bus_input_t){.key = key, .bytes = (uint32_t)bytes, .depth = 1};
        } else {
            wire->numbers[i] = plan->output_count;
            plan->outputs[plan->output_count++] = key;
            plan->tick_bytes += bytes + ENTRY_BYTES_MAX;
        }
    }
    wire->peer.output_count = FIRST_CHANNEL; /* a peer need not care for every channel */
}

/* Of the simulator, which listens; a client of it, or a peer. Sets *endpoint to what is behind the kind, or null. */
static fcsl_bus_role_t role_of(const char *address, fcsl_wire_side_t side, const char **endpoint)
{
    static const char CLIENT[] = "zenoh:";
    static const char PEER[] = "zenoh-peer:";
    const int is_peer = strncmp(address, PEER, strlen(PEER)) == 0;
    const int is_client = strncmp(address, CLIENT, strlen(CLIENT)) == 0;
    *endpoint = is_peer ? address + strlen(PEER) : is_client ? address + strlen(CLIENT) : NULL;
    return side == FCSL_WIRE_LISTEN ? FCSL_BUS_LISTEN : is_peer ? FCSL_BUS_PEER : FCSL_BUS_CLIENT;
}

static int open_session(wire_t *wire, const char *address, const plan_t *plan, uint64_t deadline_ns, char *error,
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
        .watched_count = bus_peer_watched(wire->peer.side),
    };
    if (fcsl_bus_open(&options, &wire->peer.bus, error, error_size) != 0) {
        return -1;
    }
    if (wire->peer.side == FCSL_WIRE_CONNECT &&
        bus_peer_wait(&wire->peer, endpoint, deadline_ns, error, error_size) != 0) {
        (void)fcsl_bus_close(wire->peer.bus, CLOSE_MS);
        return -1;
    }
    return 0;
}

static int check(const char *name_space, const fcsl_machine_t *machine, char *error, size_t error_size)
{
    const size_t room = FCSL_BUS_KEY_MAX - 2u;
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
    plan_t plan = {.inputs = calloc((size_t)channels + FIRST_CHANNEL, sizeof *plan.inputs),
                   .outputs = calloc((size_t)channels + FIRST_CHANNEL, sizeof *plan.outputs)};
    wire_t *self = allocate(table, side);
    int failed = -1;
    if (self == NULL || plan.inputs == NULL || plan.outputs == NULL) {
        (void)snprintf(error, error_size, "out of memory for the bus");
    } else {
        fill_plan(self, name_space, &plan);
        failed = open_session(self, address, &plan, deadline_ns, error, error_size);
    }
    free(plan.inputs);
    free((void *)plan.outputs);
    if (failed) {
        if (self != NULL) {
            release(self);
        }
        return -1;
    }
    *wire = (fcsl_wire_t){
        .ctx = self,
        .send = named_send,
        .receive = named_receive,
        .explain = named_explain,
        .close = named_close,
        .counters = &fcsl_wire_named_counters,
        .count = named_count,
    };
    return 0;
}
