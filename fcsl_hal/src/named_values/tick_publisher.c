/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine's channels under their keys, for observers: the session, and what a tick puts on it.
 */
#include "fcsl/fcsl_tick_publisher.h"
#include "fcsl/fcsl_error.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "codec/codec_layout.h"
#include "commit.h"
#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_gate.h"
#include "name_space.h"
#include "payload.h"

enum {
    COMMIT = 0, /* outputs: the commits, the host writes, then the channels */
    WRITES = 1,
    WRITTEN = 2,
    CHANNELS = 3,
    DESCRIPTOR = 0, /* answers */
    CHECKPOINT = 1,
    ANSWERS = 2,
    WRITTEN_BYTES = 16,
    LONG_WRITES = 4, /* of the longest, as many are posted, before all of them must have left */
    TICKS_POSTED = 64, /* at most, before all of them must have left */
    TICKS_SPARE = 2, /* one that is leaving, and what is lost where the ring ends */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside a message */
    CLOSE_MS = 2000
};
/* Fewer ticks are posted at a time where these would take more. */
static const uint64_t RING_BYTES = UINT64_C(4) << 20;
/* For host writes, at least. */
static const uint64_t WRITES_BYTES_MIN = UINT64_C(1) << 20;

struct fcsl_tick_publisher {
    fcsl_channel_table_t table;
    fcsl_bus_t *bus;
    uint8_t *fresh; /* of each channel: has a value in the tick */
    uint32_t *ages; /* of each channel, in the tick posted before */
    int64_t *stamps_ns; /* likewise */
    payload_t payload;
    uint8_t *value; /* the longest of a channel, or a commit */
    uint64_t tick;  /* posted before */
    int has_begun;  /* there is one */
    uint32_t ticks; /* that the ring holds */
    uint32_t room;  /* of them, free for certain */
    uint64_t writes_bytes; /* of the ring, for host writes */
    uint64_t writes_room;  /* of them, free for certain */
};

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

static uint32_t word_at(const uint8_t *data, uint32_t offset)
{
    uint32_t word = 0;
    memcpy(&word, data + offset, sizeof word);
    return word;
}

/* Whether a sample came since the tick posted before: without one, the age would have grown by the ticks between. */
static int is_sampled(fcsl_tick_publisher_t *publisher, uint32_t number, const uint8_t *data, uint64_t tick)
{
    const fcsl_channel_t *channel = &publisher->table.machine->channels[number];
    const uint32_t before = publisher->ages[number];
    const int64_t stamped_ns = publisher->stamps_ns[number];
    publisher->ages[number] = word_at(data, channel->age_offset);
    memcpy(&publisher->stamps_ns[number], data + channel->stamp_offset, sizeof stamped_ns);
    return !publisher->has_begun || publisher->stamps_ns[number] != stamped_ns ||
           data[channel->attached_offset] == 0u || publisher->ages[number] == 0u ||
           (publisher->ages[number] != UINT32_MAX && publisher->ages[number] != before + (tick - publisher->tick));
}

/* A value that its message cannot hold is none of the tick. */
static int post_value(fcsl_tick_publisher_t *publisher, uint32_t number, const uint8_t *data, uint64_t time_ns)
{
    uint32_t size = 0;
    if (payload_write(&publisher->payload, number, data, (int64_t)time_ns, publisher->value, &size) != 0) {
        publisher->fresh[number] = 0;
        return 0;
    }
    return fcsl_bus_post(publisher->bus, CHANNELS + number, publisher->value, size);
}

static int post_direction(fcsl_tick_publisher_t *publisher, const commit_t *commit, const uint8_t *data,
                          uint64_t time_ns)
{
    const fcsl_machine_t *machine = publisher->table.machine;
    int failed = 0;
    for (uint32_t i = 0; i < machine->channel_count && !failed; i++) {
        publisher->fresh[i] = machine->channels[i].direction == commit->direction &&
                              (commit->direction != FCSL_SENSOR || is_sampled(publisher, i, data, commit->tick));
        failed = publisher->fresh[i] != 0u && post_value(publisher, i, data, time_ns) != 0;
    }
    commit_write(commit, publisher->fresh, publisher->value);
    return failed || fcsl_bus_post(publisher->bus, COMMIT, publisher->value, commit_bytes(commit->channels)) != 0;
}

static int has_reports(const fcsl_machine_t *machine)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        if (machine->channels[i].direction == FCSL_REPORT) {
            return 1;
        }
    }
    return 0;
}

int fcsl_tick_publisher_post(fcsl_tick_publisher_t *publisher, const void *data, uint64_t tick, uint64_t time_ns,
                             int requires_arming)
{
    const fcsl_machine_t *machine = publisher->table.machine;
    const uint8_t *bytes = data;
    commit_t commit = {.tick = tick,
                       .time_ns = time_ns,
                       .table_hash = publisher->table.hash,
                       .direction = FCSL_SENSOR,
                       .channels = (uint16_t)machine->channel_count};
    publisher->room -= publisher->room > 0u;
    int failed = post_direction(publisher, &commit, bytes, time_ns);
    commit.direction = FCSL_ACTUATOR;
    commit.time_ns = 0;
    commit.armed = !requires_arming && fcsl_is_armed(machine, bytes);
    failed = failed || post_direction(publisher, &commit, bytes, time_ns) != 0;
    if (!failed && has_reports(machine)) {
        commit.direction = FCSL_REPORT;
        commit.armed = 0;
        failed = post_direction(publisher, &commit, bytes, time_ns) != 0;
    }
    publisher->tick = tick;
    publisher->has_begun = !failed;
    return failed ? -1 : 0;
}

void fcsl_tick_publisher_begin(fcsl_tick_publisher_t *publisher)
{
    publisher->has_begun = 0;
}

/* ---- host writes ---------------------------------------------------------------------------------------------------- */

int fcsl_tick_publisher_writes_watched(const fcsl_tick_publisher_t *publisher)
{
    return fcsl_bus_matched(publisher->bus, WRITES);
}

static int post_from_writes_room(fcsl_tick_publisher_t *publisher, uint32_t output, const void *bytes, size_t size)
{
    const uint64_t needed = size + ENTRY_BYTES_MAX;
    if (needed > publisher->writes_room) {
        return -1;
    }
    publisher->writes_room -= needed;
    return fcsl_bus_post(publisher->bus, output, bytes, size);
}

int fcsl_tick_publisher_post_write(fcsl_tick_publisher_t *publisher, const void *bytes, size_t size)
{
    return post_from_writes_room(publisher, WRITES, bytes, size);
}

int fcsl_tick_publisher_post_written(fcsl_tick_publisher_t *publisher, uint64_t ticks, uint64_t number)
{
    uint8_t bytes[WRITTEN_BYTES];
    fcsl_put_u64(bytes, ticks);
    fcsl_put_u64(bytes + 8, number);
    return post_from_writes_room(publisher, WRITTEN, bytes, sizeof bytes);
}

int fcsl_tick_publisher_answer_checkpoint(fcsl_tick_publisher_t *publisher, const void *bytes, size_t size)
{
    return fcsl_bus_answer(publisher->bus, CHECKPOINT, bytes, size);
}

/* ---- room ----------------------------------------------------------------------------------------------------------- */

int fcsl_tick_publisher_watched(const fcsl_tick_publisher_t *publisher)
{
    int watched = fcsl_bus_matched(publisher->bus, COMMIT) || fcsl_tick_publisher_writes_watched(publisher);
    for (uint32_t i = 0; i < publisher->table.machine->channel_count && !watched; i++) {
        watched = fcsl_bus_matched(publisher->bus, CHANNELS + i);
    }
    return watched;
}

/* Once everything has left, the ring holds as many ticks as it was made for, and as many writes. */
int fcsl_tick_publisher_ready(fcsl_tick_publisher_t *publisher)
{
    if (publisher->room == 0u || publisher->writes_room < publisher->writes_bytes / 2u) {
        fcsl_bus_counters_t now;
        fcsl_bus_count(publisher->bus, &now);
        const int empty = now.posted == now.put + now.put_failed;
        publisher->room = empty ? publisher->ticks : 0u;
        publisher->writes_room = empty ? publisher->writes_bytes : 0u;
    }
    return publisher->room > 0u;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

static int check(const fcsl_machine_t *machine, const char *name_space, fcsl_error_t *error)
{
    static const char LONGEST[] = "@checkpoint"; /* of the names that are no channels */
    const size_t before = strlen(name_space) + strlen(machine->name) + 2u;
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const char *name = machine->channels[i].name;
        if (strcmp(name, "tick") == 0) {
            return fcsl_fail(error, "channel 'tick' cannot go over the bus: the commits have its key");
        }
        if (before + strlen(name) > FCSL_BUS_KEY_MAX) {
            return fcsl_fail(error, "the key of channel '%.100s' is longer than %u bytes", name, FCSL_BUS_KEY_MAX);
        }
        if (payload_bytes(machine, i) > FCSL_BUS_MESSAGE_MAX) {
            return fcsl_fail(error, "channel '%.100s' has %u bytes; a message of the bus has at most %u", name,
                             payload_bytes(machine, i), FCSL_BUS_MESSAGE_MAX);
        }
    }
    if (before + strlen(LONGEST) > FCSL_BUS_KEY_MAX) {
        return fcsl_fail(error, "the keys under namespace '%.100s' are longer than %u bytes", name_space,
                         FCSL_BUS_KEY_MAX);
    }
    return 0;
}

static fcsl_tick_publisher_t *allocate(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const size_t channels = machine->channel_count;
    size_t longest = commit_bytes(machine->channel_count);
    fcsl_tick_publisher_t *publisher = calloc(1, sizeof *publisher);
    (void)fcsl_fail(error, "out of memory for observers");
    if (publisher == NULL) {
        return NULL;
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        longest = payload_bytes(machine, i) > longest ? payload_bytes(machine, i) : longest;
    }
    publisher->table = fcsl_channel_table(machine);
    publisher->fresh = calloc(channels + 1u, 1);
    publisher->ages = calloc(channels + 1u, sizeof *publisher->ages);
    publisher->stamps_ns = calloc(channels + 1u, sizeof *publisher->stamps_ns);
    publisher->value = calloc(longest, 1);
    if (publisher->fresh == NULL || publisher->ages == NULL || publisher->stamps_ns == NULL ||
        publisher->value == NULL || payload_open(&publisher->payload, machine, error) != 0) {
        fcsl_tick_publisher_close(publisher);
        return NULL;
    }
    return publisher;
}

/* The ring's bytes, and what it holds: ticks, and host writes. */
static uint32_t size_ring(fcsl_tick_publisher_t *publisher, uint32_t write_bytes)
{
    const fcsl_machine_t *machine = publisher->table.machine;
    uint64_t tick_bytes = 3u * (commit_bytes(machine->channel_count) + ENTRY_BYTES_MAX);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        tick_bytes += payload_bytes(machine, i) + ENTRY_BYTES_MAX;
    }
    const uint64_t ticks = RING_BYTES / tick_bytes;
    publisher->ticks = ticks < 1u ? 1u : ticks > TICKS_POSTED ? TICKS_POSTED : (uint32_t)ticks;
    const uint64_t writes = LONG_WRITES * ((uint64_t)write_bytes + ENTRY_BYTES_MAX);
    publisher->writes_bytes = writes < WRITES_BYTES_MIN ? WRITES_BYTES_MIN : writes;
    const uint64_t bytes = tick_bytes * (publisher->ticks + TICKS_SPARE) + publisher->writes_bytes;
    return bytes < UINT32_MAX ? (uint32_t)bytes : UINT32_MAX; /* the bus refuses so many */
}

/* Writes a key to its place in `keys`. */
static const char *write_key(char *keys, uint32_t place, const fcsl_tick_publisher_options_t *options,
                             const char *machine, const char *name)
{
    char *key = keys + (size_t)place * (FCSL_BUS_KEY_MAX + 1u);
    const char *name_space = options->name_space;
    const int length = name_space_trim(&name_space);
    (void)snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%.*s%s%s/%s", length, name_space, length > 0 ? "/" : "", machine, name);
    return key;
}

static int open_session(fcsl_tick_publisher_t *publisher, const fcsl_tick_publisher_options_t *options,
                        const char **outputs, char *keys, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = publisher->table.machine;
    const uint32_t count = machine->channel_count + CHANNELS;
    const fcsl_bus_answer_t answers[ANSWERS] = {
        [DESCRIPTOR] = {.key = write_key(keys, count + DESCRIPTOR, options, machine->name, "@descriptor"),
                        .bytes = options->descriptor,
                        .size = (uint32_t)strlen(options->descriptor)},
        [CHECKPOINT] = {.key = write_key(keys, count + CHECKPOINT, options, machine->name, "@checkpoint")},
    };
    outputs[COMMIT] = write_key(keys, COMMIT, options, machine->name, "tick");
    outputs[WRITES] = write_key(keys, WRITES, options, machine->name, "@writes");
    outputs[WRITTEN] = write_key(keys, WRITTEN, options, machine->name, "@written");
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        outputs[CHANNELS + i] = write_key(keys, CHANNELS + i, options, machine->name, machine->channels[i].name);
    }
    const fcsl_bus_options_t bus = {.role = FCSL_BUS_LISTEN,
                                    .endpoint = options->endpoint,
                                    .observer = 1,
                                    .ring_bytes = size_ring(publisher, options->write_bytes),
                                    .outputs = outputs,
                                    .output_count = count,
                                    .answers = answers,
                                    .answer_count = ANSWERS};
    return fcsl_bus_open(&bus, &publisher->bus, error);
}

int fcsl_tick_publisher_open(const fcsl_tick_publisher_options_t *options, const fcsl_machine_t *machine,
                             fcsl_tick_publisher_t **publisher, fcsl_error_t *error)
{
    const size_t count = (size_t)machine->channel_count + CHANNELS;
    int failed = -1;
    if (check(machine, options->name_space, error) != 0) {
        return -1;
    }
    fcsl_tick_publisher_t *self = allocate(machine, error);
    const char **outputs = calloc(count, sizeof *outputs);
    char *keys = calloc(count + ANSWERS, FCSL_BUS_KEY_MAX + 1u);
    if (self != NULL && outputs != NULL && keys != NULL) {
        failed = open_session(self, options, outputs, keys, error);
    }
    free(keys);
    free((void *)outputs);
    if (failed) {
        fcsl_tick_publisher_close(self);
        return -1;
    }
    *publisher = self;
    return 0;
}

void fcsl_tick_publisher_close(fcsl_tick_publisher_t *publisher)
{
    if (publisher == NULL) {
        return;
    }
    if (publisher->bus != NULL) {
        (void)fcsl_bus_close(publisher->bus,
                             CLOSE_MS); /* frozen observers may hold it up: what is left of it goes on alone */
    }
    payload_close(&publisher->payload);
    free(publisher->fresh);
    free(publisher->ages);
    free(publisher->stamps_ns);
    free(publisher->value);
    free(publisher);
}
