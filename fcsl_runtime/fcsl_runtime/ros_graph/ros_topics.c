/* SPDX-License-Identifier: Apache-2.0
 *
 * Names, types and quality of service are those of docs/guide/ros2.md.
 */
#include "ros_topics.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_tick_time.h"
#include "messages/event_message.h"
#include "messages/schema.h"
#include "messages/type_hash.h"
#include "machine/fault_place.h"

enum {
    /* Encapsulation, stamp, empty frame_id and tick: in these alone do latched messages of the same content differ. */
    HEAD_BYTES = 4 + 8 + 8 + 8,
    CLOCK_BYTES = 4 + 8,
    PADDING_BYTES = 8, /* before a number or a length, at most, with that length */
    EVENTS_OF_A_TICK = 8, /* that are put; more follow with the next one */
    DEPTH_LATCHED = 1,
    DEPTH_EVENT = 100,
    DEPTH_COMMAND = 10,
    DEPTH_STREAM = 2000, /* what a subscriber may lag behind before a reliable bridge overwrites messages */
};

/* A topic of every machine. */
typedef struct {
    fcsl_tick_message_t what;
    int latched;
    const char *name; /* behind the machine's */
    const char *type;
    const char *schema;
} fixed_t;

static const fixed_t FIXED[] = {
    {FCSL_TICK_STATE, 1, "state", "fcsl_msgs/msg/MachineState", FCSL_SCHEMA_MACHINE_STATE},
    {FCSL_TICK_HEALTH, 1, "health", "fcsl_msgs/msg/InstanceHealth", FCSL_SCHEMA_INSTANCE_HEALTH},
    {FCSL_TICK_FAULTS, 1, "faults", "fcsl_msgs/msg/FaultCounters", FCSL_SCHEMA_FAULT_COUNTERS},
    {FCSL_TICK_TRANSITION, 0, "transitions", "fcsl_msgs/msg/TransitionEvent", FCSL_SCHEMA_TRANSITION_EVENT},
};
enum { FIXED_COUNT = sizeof FIXED / sizeof FIXED[0] };

/* The topic's endpoint. */
static int name_endpoint(ros_topics_t *topics, ros_topic_t *topic, const char *machine, const char *name,
                         const ros_quality_t *quality, fcsl_error_t *error)
{
    return ros_endpoint_write(&topic->endpoint, &topics->place, machine, name, quality,
                              (uint32_t)(topic - topics->topics), error);
}

/* The same where the complete text of the type is known. */
static int announce(ros_topics_t *topics, ros_topic_t *topic, const char *machine, const char *name, const char *type,
                    const char *schema, unsigned depth, fcsl_error_t *error)
{
    char hash[FCSL_TYPE_HASH_BYTES];
    if (fcsl_type_hash(type, schema, hash) != 0) {
        return fcsl_fail(error, "there is no type hash of the interface %.200s", type);
    }
    const ros_quality_t quality = {
        .kind = ROS_PUBLISHER, .type = type, .hash = hash, .reliable = 1, .latched = topic->latched, .depth = depth};
    return name_endpoint(topics, topic, machine, name, &quality, error);
}

/* ---- the topics of a machine ---------------------------------------------------------------------------------------- */

/* Bytes that no message of state, transition, health or faults exceeds. */
static uint32_t tick_message_bytes(const fcsl_machine_t *machine)
{
    size_t longest = 0; /* of the names, of which a message has four at most */
    size_t bytes = HEAD_BYTES;
    for (uint32_t i = 0; i < machine->state_count; i++) {
        const size_t length = strlen(machine->states[i].name);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->request_count; i++) {
        const size_t length = strlen(machine->requests[i]);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const size_t length = strlen(machine->instances[i].name);
        longest = length > longest ? length : longest;
        bytes += PADDING_BYTES + length + 8u + 8u + PADDING_BYTES + fcsl_fault_text_bytes(machine);
    }
    bytes += 4u * (PADDING_BYTES + longest + 1u) + 4u * PADDING_BYTES;
    return bytes < FCSL_MESSAGE_BYTES_MAX ? (uint32_t)bytes : FCSL_MESSAGE_BYTES_MAX;
}

static int add_fixed(ros_topics_t *topics, const fixed_t *fixed, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_TICK_MESSAGE;
    topic->what = fixed->what;
    topic->latched = fixed->latched;
    topic->longest = tick_message_bytes(topics->machine);
    topic->last_message = malloc(topic->longest);
    topics->latched_count += fixed->latched ? 1u : 0u;
    if (topic->last_message == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    return announce(topics, topic, topics->machine->name, fixed->name, fixed->type, fixed->schema,
                    fixed->latched ? DEPTH_LATCHED : DEPTH_EVENT, error);
}

static int add_events(ros_topics_t *topics, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_EVENTS;
    topic->longest = (uint32_t)fcsl_event_message_capacity(topics->machine);
    return announce(topics, topic, topics->machine->name, "events", "fcsl_msgs/msg/Event", FCSL_SCHEMA_EVENT,
                    DEPTH_EVENT, error);
}

/* Of all topics only this one is outside of the namespace. */
static int add_clock(ros_topics_t *topics, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_CLOCK;
    topic->longest = CLOCK_BYTES;
    return announce(topics, topic, NULL, "/clock", "rosgraph_msgs/msg/Clock", FCSL_SCHEMA_CLOCK, DEPTH_STREAM, error);
}

static int add_instance(ros_topics_t *topics, const fcsl_instance_t *instance, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_INSTANCE;
    char *schema = fcsl_interface_schema(instance);
    char *name = fcsl_interface_topic(instance);
    int failed = schema == NULL || name == NULL ? fcsl_fail(error, "out of memory for topics") : 0;
    if (failed == 0) {
        failed = fcsl_layout_build(topics->machine, instance, &topic->layout, error) != 0 ||
                 announce(topics, topic, topics->machine->name, name, instance->message_type, schema, DEPTH_STREAM,
                          error) != 0;
    }
    free(name);
    free(schema);
    topic->longest = topic->layout.size;
    return failed ? -1 : 0;
}

static int add_mapped(ros_topics_t *topics, const fcsl_ros_message_t *message, fcsl_error_t *error)
{
    fcsl_error_t reason;
    ros_topic_t *topic = &topics->topics[topics->count++];
    const ros_quality_t quality = {.kind = ROS_PUBLISHER,
                                   .type = message->type,
                                   .hash = message->type_hash,
                                   .reliable = 1,
                                   .depth = message->direction == FCSL_SENSOR ? DEPTH_STREAM : DEPTH_COMMAND};
    topic->kind = ROS_MAPPED;
    topic->mapped = message;
    topic->longest = message->composer->size;
    topic->composer = fcsl_ros_composer_new(message->composer, &reason);
    if (topic->composer == NULL) {
        return fcsl_fail(error, "topic %.100s: %s", message->topic, reason.text);
    }
    return name_endpoint(topics, topic, NULL, message->topic, &quality, error);
}

int ros_topics_build(ros_topics_t *topics, const fcsl_ros_graph_options_t *options, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = fcsl_run_machine(options->run);
    *topics = (ros_topics_t){.run = options->run, .machine = machine, .safe = fcsl_run_safe_data(options->run)};
    topics->topics =
        calloc((size_t)machine->instance_count + machine->ros_message_count + FIXED_COUNT + 2u, sizeof *topics->topics);
    if (topics->topics == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    int failed = ros_place_read(&topics->place, options->endpoint, options->name_space, machine->name, error);
    for (uint32_t i = 0; i < FIXED_COUNT && !failed; i++) {
        failed = add_fixed(topics, &FIXED[i], error);
    }
    if (machine->event_site_count > 0u && !failed) {
        failed = add_events(topics, error);
    }
    if (options->simulated && !failed) {
        failed = add_clock(topics, error);
    }
    for (uint32_t i = 0; i < machine->instance_count && !failed; i++) {
        if (machine->instances[i].published) {
            failed = add_instance(topics, &machine->instances[i], error);
        }
    }
    for (uint32_t i = 0; i < machine->ros_message_count && !failed; i++) {
        const fcsl_ros_message_t *message = &machine->ros_messages[i];
        if (message->direction == FCSL_SENSOR ? options->sensors : options->actuators) {
            failed = add_mapped(topics, message, error);
        }
    }
    for (uint32_t i = 0; i < topics->count; i++) {
        topics->topics[i].most = topics->topics[i].kind == ROS_EVENTS ? EVENTS_OF_A_TICK : 1u;
    }
    return failed;
}

void ros_topics_free(ros_topics_t *topics)
{
    for (uint32_t i = 0; i < topics->count; i++) {
        fcsl_layout_free(&topics->topics[i].layout);
        fcsl_ros_composer_free(topics->topics[i].composer);
        free(topics->topics[i].last_message);
    }
    free(topics->topics);
    *topics = (ros_topics_t){0};
}

/* ---- messages of a tick --------------------------------------------------------------------------------------------- */

static size_t write_clock(fcsl_stamp_t stamp, uint8_t *bytes)
{
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, bytes, CLOCK_BYTES);
    fcsl_cdr_time(&cdr, stamp.time_ns);
    return fcsl_cdr_end(&cdr);
}

static size_t write_tick_message(const fcsl_machine_t *machine, ros_topic_t *topic, const uint8_t *data,
                                 fcsl_stamp_t stamp, uint8_t *bytes)
{
    const int64_t size = fcsl_tick_message_write(machine, data, topic->what, stamp, bytes, topic->longest);
    if (size <= HEAD_BYTES) {
        return 0;
    }
    const uint32_t length = (uint32_t)size;
    if (topic->latched && length == topic->last_message_bytes &&
        memcmp(topic->last_message + HEAD_BYTES, bytes + HEAD_BYTES, length - HEAD_BYTES) == 0) {
        return 0;
    }
    memcpy(topic->last_message, bytes, length);
    topic->last_message_bytes = length;
    return length;
}

/* The next event up to the tick, whose time `stamp` is; that of the event is before it by their ticks. */
static size_t write_event(ros_topics_t *topics, ros_topic_t *topic, fcsl_stamp_t stamp, uint8_t *bytes)
{
    fcsl_told_event_t event;
    const uint64_t next = fcsl_run_next_event(topics->run, topic->next_event, &event);
    if (next == 0 || event.tick > stamp.tick) {
        return 0;
    }
    const uint64_t hz = topics->machine->tick_hz;
    const fcsl_stamp_t own = {.tick = event.tick,
                              .time_ns = stamp.time_ns -
                                         (fcsl_tick_time_ns(hz, stamp.tick) - fcsl_tick_time_ns(hz, event.tick))};
    topic->next_event = next;
    return fcsl_event_message(topics->machine, &event, own, bytes, topic->longest);
}

/* Whether a sample came for the tick, or nothing says when samples come. */
static int is_sampled(const fcsl_machine_t *machine, const fcsl_ros_message_t *message, const uint8_t *data)
{
    for (uint32_t i = 0; i < message->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[message->channels[i]];
        uint32_t age = 0;
        memcpy(&age, data + channel->age_offset, sizeof age);
        if (age == 0u || data[channel->attached_offset] == 0u) {
            return 1;
        }
    }
    return 0;
}

/* Actuators of a disarmed machine get their safe values. A number that its field cannot hold makes no message, and is counted. */
static size_t write_mapped(ros_topics_t *topics, const ros_topic_t *topic, const published_tick_t *tick,
                           fcsl_stamp_t stamp, uint8_t *bytes)
{
    const uint8_t *data = tick->publication;
    const fcsl_machine_t *machine = topics->machine;
    const int is_actuator = topic->mapped->direction == FCSL_ACTUATOR;
    if (topic->mapped->direction == FCSL_SENSOR && !is_sampled(machine, topic->mapped, data)) {
        return 0;
    }
    const int is_armed = !tick->requires_arming && fcsl_is_armed(machine, data);
    const uint8_t *memory = is_actuator && !is_armed && topics->safe != NULL ? topics->safe : data;
    uint32_t size = 0;
    if (fcsl_ros_compose(topic->composer, &memory, (int64_t)stamp.time_ns, bytes, &size) != FCSL_ROS_TAKEN) {
        atomic_fetch_add_explicit(&topics->refused, 1, memory_order_relaxed);
        return 0;
    }
    return size;
}

size_t ros_topics_write(ros_topics_t *topics, uint32_t number, const published_tick_t *tick, fcsl_stamp_t stamp,
                        uint8_t *bytes)
{
    const uint8_t *data = tick->publication;
    ros_topic_t *topic = &topics->topics[number];
    switch (topic->kind) {
    case ROS_CLOCK:
        return write_clock(stamp, bytes);
    case ROS_INSTANCE:
        fcsl_layout_write(&topic->layout, data, stamp.tick, stamp.time_ns, bytes);
        return topic->layout.size;
    case ROS_MAPPED:
        return write_mapped(topics, topic, tick, stamp, bytes);
    case ROS_EVENTS:
        return write_event(topics, topic, stamp, bytes);
    default:
        return write_tick_message(topics->machine, topic, data, stamp, bytes);
    }
}

void ros_topics_unsay(ros_topics_t *topics, uint32_t number)
{
    ros_topic_t *topic = &topics->topics[number];
    topic->last_message_bytes = 0;
    topic->next_event -= topic->kind == ROS_EVENTS ? 1u : 0u;
}

void ros_topics_skip(ros_topics_t *topics, uint32_t number)
{
    if (topics->topics[number].kind == ROS_EVENTS) {
        topics->topics[number].next_event = fcsl_run_event_counts(topics->run).told;
    }
}
