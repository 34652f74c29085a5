/* SPDX-License-Identifier: Apache-2.0
 *
 * Names, types and quality of service are those of docs/ros2.md.
 */
#include "ros_topics.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "messages/schema.h"
#include "messages/type_hash.h"
#include "run/fault_place.h"

enum {
    /* Encapsulation, stamp, empty frame_id and tick: in these alone do latched messages of the same content differ. */
    HEAD_BYTES = 4 + 8 + 8 + 8,
    CLOCK_BYTES = 4 + 8,
    PADDING_BYTES = 8, /* before a number or a length, at most, with that length */
    DEPTH_LATCHED = 1,
    DEPTH_EVENT = 100,
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

/* ---- keys and tokens ------------------------------------------------------------------------------------------------ */

/* A namespace may have slashes around it; a key has none. */
static int write_key(ros_topic_t *topic, const fcsl_machine_t *machine, const char *name_space, const char *name,
                     fcsl_error_t *error)
{
    name_space += strspn(name_space, "/");
    size_t length = strlen(name_space);
    while (length > 0 && name_space[length - 1] == '/') {
        length--;
    }
    const int size = snprintf(topic->key, sizeof topic->key, "%.*s%s%s/%s", (int)length, name_space,
                              length > 0 ? "/" : "", machine->name, name);
    return size < (int)sizeof topic->key
               ? 0
               : fcsl_fail(error, "topic '%.100s' of machine '%.100s' has a name of more than %u bytes", name,
                           machine->name, FCSL_BUS_KEY_MAX);
}

/* A name as one word of a key: the plugin writes a paragraph sign for each slash. */
static void write_word(const char *name, char *word, size_t size)
{
    static const char SLASH[] = "\xc2\xa7";
    size_t at = 0;
    for (; *name != '\0' && at + sizeof SLASH < size; name++) {
        if (*name == '/') {
            memcpy(word + at, SLASH, sizeof SLASH - 1u);
            at += sizeof SLASH - 1u;
        } else {
            word[at++] = *name;
        }
    }
    word[at] = '\0';
}

/* The token by which the bridge knows a publisher: "MP", topic, type, and its quality of service, which is reliable (1), volatile
 * (0) or transient local (1), keep last (0) with a depth, and the type's hash. */
static int write_token(ros_topic_t *topic, const char *type, const char *schema, unsigned depth, fcsl_error_t *error)
{
    char hash[FCSL_TYPE_HASH_BYTES];
    char name[2u * sizeof topic->key];
    char kind[2u * sizeof topic->key];
    if (fcsl_type_hash(type, schema, hash) != 0) {
        return fcsl_fail(error, "there is no type hash of the interface %.200s", type);
    }
    write_word(topic->key, name, sizeof name);
    write_word(type, kind, sizeof kind);
    const int size = snprintf(topic->token, sizeof topic->token, "@/{zid}/@ros2_lv/MP/%s/%s/:1:%d:0,%u:typehash=%s;",
                              name, kind, topic->latched, depth, hash);
    return size < (int)sizeof topic->token
               ? 0
               : fcsl_fail(error, "topic %.200s of type %.200s has too long names", topic->key, type);
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

static int add_fixed(ros_topics_t *topics, const fixed_t *fixed, const char *name_space, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_TICK_MESSAGE;
    topic->what = fixed->what;
    topic->latched = fixed->latched;
    topic->longest = tick_message_bytes(topics->machine);
    topic->said = malloc(topic->longest);
    topics->latched_count += fixed->latched ? 1u : 0u;
    if (topic->said == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    return write_key(topic, topics->machine, name_space, fixed->name, error) != 0
               ? -1
               : write_token(topic, fixed->type, fixed->schema, fixed->latched ? DEPTH_LATCHED : DEPTH_EVENT, error);
}

/* Of all topics only this one is outside of the namespace. */
static int add_clock(ros_topics_t *topics, fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_CLOCK;
    topic->longest = CLOCK_BYTES;
    (void)snprintf(topic->key, sizeof topic->key, "clock");
    return write_token(topic, "rosgraph_msgs/msg/Clock", FCSL_SCHEMA_CLOCK, DEPTH_STREAM, error);
}

static int add_instance(ros_topics_t *topics, const fcsl_instance_t *instance, const char *name_space,
                        fcsl_error_t *error)
{
    ros_topic_t *topic = &topics->topics[topics->count++];
    topic->kind = ROS_INSTANCE;
    char *schema = fcsl_interface_schema(instance);
    if (schema == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    const int failed = fcsl_layout_build(topics->machine, instance, &topic->layout, error) != 0 ||
                       write_key(topic, topics->machine, name_space, instance->name, error) != 0 ||
                       write_token(topic, instance->message_type, schema, DEPTH_STREAM, error) != 0;
    free(schema);
    topic->longest = topic->layout.size;
    return failed ? -1 : 0;
}

int ros_topics_build(ros_topics_t *topics, const fcsl_machine_t *machine, const char *name_space, int clock,
                     fcsl_error_t *error)
{
    *topics = (ros_topics_t){.machine = machine};
    topics->topics = calloc((size_t)machine->instance_count + FIXED_COUNT + 1u, sizeof *topics->topics);
    if (topics->topics == NULL) {
        return fcsl_fail(error, "out of memory for topics");
    }
    int failed = 0;
    for (uint32_t i = 0; i < FIXED_COUNT && !failed; i++) {
        failed = add_fixed(topics, &FIXED[i], name_space, error);
    }
    if (clock && !failed) {
        failed = add_clock(topics, error);
    }
    for (uint32_t i = 0; i < machine->instance_count && !failed; i++) {
        if (machine->instances[i].published) {
            failed = add_instance(topics, &machine->instances[i], name_space, error);
        }
    }
    return failed;
}

void ros_topics_free(ros_topics_t *topics)
{
    for (uint32_t i = 0; i < topics->count; i++) {
        fcsl_layout_free(&topics->topics[i].layout);
        free(topics->topics[i].said);
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
    if (topic->latched && length == topic->said_bytes &&
        memcmp(topic->said + HEAD_BYTES, bytes + HEAD_BYTES, length - HEAD_BYTES) == 0) {
        return 0;
    }
    memcpy(topic->said, bytes, length);
    topic->said_bytes = length;
    return length;
}

size_t ros_topics_write(ros_topics_t *topics, uint32_t number, const uint8_t *data, fcsl_stamp_t stamp, uint8_t *bytes)
{
    ros_topic_t *topic = &topics->topics[number];
    switch (topic->kind) {
    case ROS_CLOCK:
        return write_clock(stamp, bytes);
    case ROS_INSTANCE:
        fcsl_layout_write(&topic->layout, data, stamp.tick, stamp.time_ns, bytes);
        return topic->layout.size;
    default:
        return write_tick_message(topics->machine, topic, data, stamp, bytes);
    }
}
