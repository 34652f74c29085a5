/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine's channels under their keys, for observers: the session, and what a tick puts on it.
 */
#include "fcsl/fcsl_mirror.h"
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

struct fcsl_mirror {
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
static int is_sampled(fcsl_mirror_t *mirror, uint32_t number, const uint8_t *data, uint64_t tick)
{
    const fcsl_channel_t *channel = &mirror->table.machine->channels[number];
    const uint32_t before = mirror->ages[number];
    const int64_t stamped_ns = mirror->stamps_ns[number];
    mirror->ages[number] = word_at(data, channel->age_offset);
    memcpy(&mirror->stamps_ns[number], data + channel->stamp_offset, sizeof stamped_ns);
    return !mirror->has_begun || mirror->stamps_ns[number] != stamped_ns || data[channel->attached_offset] == 0u ||
           mirror->ages[number] == 0u ||
           (mirror->ages[number] != UINT32_MAX && mirror->ages[number] != before + (tick - mirror->tick));
}

/* A value that its message cannot hold is none of the tick. */
static int post_value(fcsl_mirror_t *mirror, uint32_t number, const uint8_t *data, uint64_t time_ns)
{
    uint32_t size = 0;
    if (payload_write(&mirror->payload, number, data, (int64_t)time_ns, mirror->value, &size) != 0) {
        mirror->fresh[number] = 0;
        return 0;
    }
    return fcsl_bus_post(mirror->bus, CHANNELS + number, mirror->value, size);
}

static int post_direction(fcsl_mirror_t *mirror, const commit_t *commit, const uint8_t *data, uint64_t time_ns)
{
    const fcsl_machine_t *machine = mirror->table.machine;
    int failed = 0;
    for (uint32_t i = 0; i < machine->channel_count && !failed; i++) {
        mirror->fresh[i] = machine->channels[i].direction == commit->direction &&
                           (commit->direction != FCSL_SENSOR || is_sampled(mirror, i, data, commit->tick));
        failed = mirror->fresh[i] != 0u && post_value(mirror, i, data, time_ns) != 0;
    }
    commit_write(commit, mirror->fresh, mirror->value);
    return failed || fcsl_bus_post(mirror->bus, COMMIT, mirror->value, commit_bytes(commit->channels)) != 0;
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

int fcsl_mirror_post(fcsl_mirror_t *mirror, const void *data, uint64_t tick, uint64_t time_ns, int requires_arming)
{
    const fcsl_machine_t *machine = mirror->table.machine;
    const uint8_t *bytes = data;
    commit_t commit = {.tick = tick,
                       .time_ns = time_ns,
                       .table_hash = mirror->table.hash,
                       .direction = FCSL_SENSOR,
                       .channels = (uint16_t)machine->channel_count};
    mirror->room -= mirror->room > 0u;
    int failed = post_direction(mirror, &commit, bytes, time_ns);
    commit.direction = FCSL_ACTUATOR;
    commit.time_ns = 0;
    commit.armed = !requires_arming && fcsl_is_armed(machine, bytes);
    failed = failed || post_direction(mirror, &commit, bytes, time_ns) != 0;
    if (!failed && has_reports(machine)) {
        commit.direction = FCSL_REPORT;
        commit.armed = 0;
        failed = post_direction(mirror, &commit, bytes, time_ns) != 0;
    }
    mirror->tick = tick;
    mirror->has_begun = !failed;
    return failed ? -1 : 0;
}

void fcsl_mirror_begin(fcsl_mirror_t *mirror)
{
    mirror->has_begun = 0;
}

/* ---- host writes ---------------------------------------------------------------------------------------------------- */

int fcsl_mirror_writes_watched(const fcsl_mirror_t *mirror)
{
    return fcsl_bus_matched(mirror->bus, WRITES);
}

static int post_from_writes_room(fcsl_mirror_t *mirror, uint32_t output, const void *bytes, size_t size)
{
    const uint64_t needed = size + ENTRY_BYTES_MAX;
    if (needed > mirror->writes_room) {
        return -1;
    }
    mirror->writes_room -= needed;
    return fcsl_bus_post(mirror->bus, output, bytes, size);
}

int fcsl_mirror_post_write(fcsl_mirror_t *mirror, const void *bytes, size_t size)
{
    return post_from_writes_room(mirror, WRITES, bytes, size);
}

int fcsl_mirror_post_written(fcsl_mirror_t *mirror, uint64_t ticks, uint64_t number)
{
    uint8_t bytes[WRITTEN_BYTES];
    fcsl_put_u64(bytes, ticks);
    fcsl_put_u64(bytes + 8, number);
    return post_from_writes_room(mirror, WRITTEN, bytes, sizeof bytes);
}

int fcsl_mirror_answer_checkpoint(fcsl_mirror_t *mirror, const void *bytes, size_t size)
{
    return fcsl_bus_answer(mirror->bus, CHECKPOINT, bytes, size);
}

/* ---- room ----------------------------------------------------------------------------------------------------------- */

int fcsl_mirror_watched(const fcsl_mirror_t *mirror)
{
    int watched = fcsl_bus_matched(mirror->bus, COMMIT) || fcsl_mirror_writes_watched(mirror);
    for (uint32_t i = 0; i < mirror->table.machine->channel_count && !watched; i++) {
        watched = fcsl_bus_matched(mirror->bus, CHANNELS + i);
    }
    return watched;
}

/* Once everything has left, the ring holds as many ticks as it was made for, and as many writes. */
int fcsl_mirror_ready(fcsl_mirror_t *mirror)
{
    if (mirror->room == 0u || mirror->writes_room < mirror->writes_bytes / 2u) {
        fcsl_bus_counters_t now;
        fcsl_bus_count(mirror->bus, &now);
        const int empty = now.posted == now.put + now.put_failed;
        mirror->room = empty ? mirror->ticks : 0u;
        mirror->writes_room = empty ? mirror->writes_bytes : 0u;
    }
    return mirror->room > 0u;
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

static fcsl_mirror_t *allocate(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const size_t channels = machine->channel_count;
    size_t longest = commit_bytes(machine->channel_count);
    fcsl_mirror_t *mirror = calloc(1, sizeof *mirror);
    (void)fcsl_fail(error, "out of memory for observers");
    if (mirror == NULL) {
        return NULL;
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        longest = payload_bytes(machine, i) > longest ? payload_bytes(machine, i) : longest;
    }
    mirror->table = fcsl_channel_table(machine);
    mirror->fresh = calloc(channels + 1u, 1);
    mirror->ages = calloc(channels + 1u, sizeof *mirror->ages);
    mirror->stamps_ns = calloc(channels + 1u, sizeof *mirror->stamps_ns);
    mirror->value = calloc(longest, 1);
    if (mirror->fresh == NULL || mirror->ages == NULL || mirror->stamps_ns == NULL || mirror->value == NULL ||
        payload_open(&mirror->payload, machine, error) != 0) {
        fcsl_mirror_close(mirror);
        return NULL;
    }
    return mirror;
}

/* The ring's bytes, and what it holds: ticks, and host writes. */
static uint32_t size_ring(fcsl_mirror_t *mirror, uint32_t write_bytes)
{
    const fcsl_machine_t *machine = mirror->table.machine;
    uint64_t tick_bytes = 3u * (commit_bytes(machine->channel_count) + ENTRY_BYTES_MAX);
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        tick_bytes += payload_bytes(machine, i) + ENTRY_BYTES_MAX;
    }
    const uint64_t ticks = RING_BYTES / tick_bytes;
    mirror->ticks = ticks < 1u ? 1u : ticks > TICKS_POSTED ? TICKS_POSTED : (uint32_t)ticks;
    const uint64_t writes = LONG_WRITES * ((uint64_t)write_bytes + ENTRY_BYTES_MAX);
    mirror->writes_bytes = writes < WRITES_BYTES_MIN ? WRITES_BYTES_MIN : writes;
    const uint64_t bytes = tick_bytes * (mirror->ticks + TICKS_SPARE) + mirror->writes_bytes;
    return bytes < UINT32_MAX ? (uint32_t)bytes : UINT32_MAX; /* the bus refuses so many */
}

/* Writes a key to its place in `keys`. */
static const char *write_key(char *keys, uint32_t place, const fcsl_mirror_options_t *options, const char *machine,
                             const char *name)
{
    char *key = keys + (size_t)place * (FCSL_BUS_KEY_MAX + 1u);
    const char *name_space = options->name_space;
    const int length = name_space_trim(&name_space);
    (void)snprintf(key, FCSL_BUS_KEY_MAX + 1u, "%.*s%s%s/%s", length, name_space, length > 0 ? "/" : "", machine, name);
    return key;
}

static int open_session(fcsl_mirror_t *mirror, const fcsl_mirror_options_t *options, const char **outputs, char *keys,
                        fcsl_error_t *error)
{
    const fcsl_machine_t *machine = mirror->table.machine;
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
                                    .ring_bytes = size_ring(mirror, options->write_bytes),
                                    .outputs = outputs,
                                    .output_count = count,
                                    .answers = answers,
                                    .answer_count = ANSWERS};
    return fcsl_bus_open(&bus, &mirror->bus, error);
}

int fcsl_mirror_open(const fcsl_mirror_options_t *options, const fcsl_machine_t *machine, fcsl_mirror_t **mirror,
                     fcsl_error_t *error)
{
    const size_t count = (size_t)machine->channel_count + CHANNELS;
    int failed = -1;
    if (check(machine, options->name_space, error) != 0) {
        return -1;
    }
    fcsl_mirror_t *self = allocate(machine, error);
    const char **outputs = calloc(count, sizeof *outputs);
    char *keys = calloc(count + ANSWERS, FCSL_BUS_KEY_MAX + 1u);
    if (self != NULL && outputs != NULL && keys != NULL) {
        failed = open_session(self, options, outputs, keys, error);
    }
    free(keys);
    free((void *)outputs);
    if (failed) {
        fcsl_mirror_close(self);
        return -1;
    }
    *mirror = self;
    return 0;
}

void fcsl_mirror_close(fcsl_mirror_t *mirror)
{
    if (mirror == NULL) {
        return;
    }
    if (mirror->bus != NULL) {
        (void)fcsl_bus_close(mirror->bus,
                             CLOSE_MS); /* frozen observers may hold it up: what is left of it goes on alone */
    }
    payload_close(&mirror->payload);
    free(mirror->fresh);
    free(mirror->ages);
    free(mirror->stamps_ns);
    free(mirror->value);
    free(mirror);
}
