/* SPDX-License-Identifier: Apache-2.0
 *
 * What a tick shows as ROS 2 messages, put into a publish queue.
 */
#include "fcsl/fcsl_tick_time.h"
#include "fcsl/fcsl_topics.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_scalar.h"
#include "messages/event_message.h"
#include "messages/message.h"

enum {
    STAMP_AT = 4,
    /* Encapsulation, stamp, empty frame_id and tick: in these alone do messages of the same content differ. */
    HEAD_BYTES = 4 + 8 + 8 + 8,
};

typedef enum { OF_INSTANCE, OF_TICK, OF_EVENTS, OF_ACTUATORS, OF_REPORTS } kind_t;

typedef struct {
    kind_t kind;
    uint32_t topic;
    uint32_t instance;
    uint32_t every;
    uint32_t size; /* of each message; of a tick's message: of the last one */
    fcsl_tick_message_t what;
    uint8_t *last_message; /* a tick's message: the last one */
    uint64_t next_event;   /* that was not put */
    const fcsl_ros_composer_t *composer;
    uint64_t refused;
} entry_t;

struct fcsl_topics {
    fcsl_run_t *run;
    fcsl_publish_queue_t *queue;
    entry_t *entries;
    uint32_t count;
    uint8_t *scratch;
};

fcsl_topics_t *fcsl_topics_new(fcsl_run_t *run, fcsl_publish_queue_t *queue, fcsl_error_t *error)
{
    fcsl_topics_t *topics = calloc(1, sizeof *topics);
    uint8_t *scratch = malloc(FCSL_MESSAGE_BYTES_MAX);
    if (topics == NULL || scratch == NULL) {
        free(topics);
        free(scratch);
        (void)fcsl_fail(error, "out of memory for topics");
        return NULL;
    }
    topics->run = run;
    topics->queue = queue;
    topics->scratch = scratch;
    return topics;
}

void fcsl_topics_free(fcsl_topics_t *topics)
{
    for (uint32_t i = 0; i < topics->count; i++) {
        free(topics->entries[i].last_message);
    }
    free(topics->entries);
    free(topics->scratch);
    free(topics);
}

static int add(fcsl_topics_t *topics, const entry_t *entry, fcsl_error_t *error)
{
    entry_t *entries = realloc(topics->entries, (topics->count + 1u) * sizeof *entries);
    if (entries == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    entries[topics->count++] = *entry;
    topics->entries = entries;
    return 0;
}

int fcsl_topics_add_instance(fcsl_topics_t *topics, uint32_t topic, uint32_t instance, uint32_t every,
                             fcsl_error_t *error)
{
    const int64_t size = fcsl_run_message(topics->run, instance, topics->scratch, FCSL_MESSAGE_BYTES_MAX);
    if (size < STAMP_AT + 8 || every == 0) {
        return fcsl_fail(error, "there is no message of instance %u", (unsigned)instance);
    }
    const entry_t entry = {
        .kind = OF_INSTANCE, .topic = topic, .instance = instance, .every = every, .size = (uint32_t)size};
    return add(topics, &entry, error);
}

int fcsl_topics_add_tick_message(fcsl_topics_t *topics, uint32_t topic, fcsl_tick_message_t what, fcsl_error_t *error)
{
    const entry_t entry = {
        .kind = OF_TICK, .topic = topic, .what = what, .last_message = malloc(FCSL_MESSAGE_BYTES_MAX)};
    if (entry.last_message == NULL || add(topics, &entry, error) != 0) {
        free(entry.last_message);
        return fcsl_fail(error, "out of memory for topics");
    }
    return 0;
}

int fcsl_topics_add_events(fcsl_topics_t *topics, uint32_t topic, fcsl_error_t *error)
{
    const entry_t entry = {.kind = OF_EVENTS, .topic = topic, .next_event = fcsl_run_event_counts(topics->run).told};
    return add(topics, &entry, error);
}

int fcsl_topics_add_channels(fcsl_topics_t *topics, uint32_t topic, fcsl_direction_t direction,
                             const fcsl_ros_composer_t *composer, uint32_t size, fcsl_error_t *error)
{
    const entry_t entry = {.kind = direction == FCSL_REPORT ? OF_REPORTS : OF_ACTUATORS,
                           .topic = topic,
                           .composer = composer,
                           .size = size};
    return add(topics, &entry, error);
}

static void put_stamp(uint8_t *message, int64_t stamp_ns)
{
    const int64_t seconds =
        stamp_ns >= 0 ? stamp_ns / FCSL_NS_PER_S : -((FCSL_NS_PER_S - 1 - stamp_ns) / FCSL_NS_PER_S);
    fcsl_put_u32(message + STAMP_AT, (uint32_t)(int32_t)seconds);
    fcsl_put_u32(message + STAMP_AT + 4, (uint32_t)(stamp_ns - seconds * FCSL_NS_PER_S));
}

static void put_instance(fcsl_topics_t *topics, const entry_t *entry, uint64_t tick, int64_t stamp_ns)
{
    if (tick % entry->every != 0) {
        return;
    }
    uint8_t *place = fcsl_publish_queue_claim(topics->queue, entry->topic, entry->size, FCSL_PUBLISH_QUEUE_STREAM);
    if (place != NULL) {
        (void)fcsl_run_message(topics->run, entry->instance, place, entry->size); /* it has been so large once */
        put_stamp(place, stamp_ns);
        fcsl_publish_queue_put(topics->queue);
    }
}

/* A message that finds no room is one that was not said: it is tried again after the next tick. */
static void put_tick_message(fcsl_topics_t *topics, entry_t *entry, int64_t stamp_ns)
{
    const int64_t size = fcsl_run_tick_message(topics->run, entry->what, topics->scratch, FCSL_MESSAGE_BYTES_MAX);
    const uint32_t bytes = size > HEAD_BYTES ? (uint32_t)size : 0u;
    const int is_event = entry->what == FCSL_TICK_TRANSITION;
    if (bytes == 0u ||
        (!is_event && bytes == entry->size &&
         memcmp(entry->last_message + HEAD_BYTES, topics->scratch + HEAD_BYTES, bytes - HEAD_BYTES) == 0)) {
        return;
    }
    uint8_t *place = fcsl_publish_queue_claim(topics->queue, entry->topic, bytes, FCSL_PUBLISH_QUEUE_CHANGE);
    if (place != NULL) {
        memcpy(entry->last_message, topics->scratch, bytes);
        entry->size = bytes;
        memcpy(place, topics->scratch, bytes);
        put_stamp(place, stamp_ns);
        fcsl_publish_queue_put(topics->queue);
    }
}

/* One that finds no room is tried again after the next tick. */
static void put_events(fcsl_topics_t *topics, entry_t *entry, int64_t stamp_ns)
{
    const fcsl_machine_t *machine = fcsl_run_machine(topics->run);
    fcsl_told_event_t event;
    uint64_t next = 0;
    while ((next = fcsl_run_next_event(topics->run, entry->next_event, &event)) != 0) {
        const fcsl_stamp_t stamp = {.tick = event.tick, .time_ns = 0};
        const uint32_t bytes =
            (uint32_t)fcsl_event_message(machine, &event, stamp, topics->scratch, FCSL_MESSAGE_BYTES_MAX);
        uint8_t *place = bytes == 0u
                             ? NULL
                             : fcsl_publish_queue_claim(topics->queue, entry->topic, bytes, FCSL_PUBLISH_QUEUE_CHANGE);
        if (place == NULL) {
            return;
        }
        memcpy(place, topics->scratch, bytes);
        put_stamp(place, stamp_ns);
        fcsl_publish_queue_put(topics->queue);
        entry->next_event = next;
    }
}

static void put_channels(fcsl_topics_t *topics, entry_t *entry, int64_t stamp_ns)
{
    const uint8_t *memory =
        entry->kind == OF_REPORTS ? fcsl_run_data(topics->run) : fcsl_run_actuator_data(topics->run);
    uint32_t size = 0;
    if (fcsl_ros_compose(entry->composer, &memory, stamp_ns, topics->scratch, &size) != FCSL_ROS_TAKEN) {
        entry->refused++;
        return;
    }
    uint8_t *place = fcsl_publish_queue_claim(topics->queue, entry->topic, size, FCSL_PUBLISH_QUEUE_STREAM);
    if (place != NULL) {
        memcpy(place, topics->scratch, size);
        fcsl_publish_queue_put(topics->queue);
    }
}

void fcsl_topics_put(fcsl_topics_t *topics, int64_t stamp_ns)
{
    const uint64_t tick = fcsl_run_tick(topics->run) - 1u;
    for (uint32_t i = 0; i < topics->count; i++) {
        entry_t *entry = &topics->entries[i];
        switch (entry->kind) {
        case OF_INSTANCE:
            put_instance(topics, entry, tick, stamp_ns);
            break;
        case OF_TICK:
            put_tick_message(topics, entry, stamp_ns);
            break;
        case OF_EVENTS:
            put_events(topics, entry, stamp_ns);
            break;
        default:
            put_channels(topics, entry, stamp_ns);
        }
    }
}

void fcsl_topics_put_changes(fcsl_topics_t *topics, int64_t stamp_ns)
{
    for (uint32_t i = 0; i < topics->count; i++) {
        entry_t *entry = &topics->entries[i];
        if (entry->kind == OF_TICK && entry->what != FCSL_TICK_TRANSITION) {
            put_tick_message(topics, entry, stamp_ns);
        }
    }
}

uint64_t fcsl_topics_refused(const fcsl_topics_t *topics, uint32_t topic)
{
    for (uint32_t i = 0; i < topics->count; i++) {
        if (topics->entries[i].topic == topic) {
            return topics->entries[i].refused;
        }
    }
    return 0;
}
