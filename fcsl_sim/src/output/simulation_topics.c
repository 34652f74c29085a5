/* SPDX-License-Identifier: Apache-2.0
 *
 * The ROS 2 topics of a simulation: what each tick shows, into a publish queue.
 */
#include "simulation_topics.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"

enum {
    CLOCK_BYTES = 12, /* encapsulation, s, ns */
    STAMP_AT = 4,
    TICK_AT = 20, /* behind encapsulation, stamp and an empty frame_id, padded */
};

typedef enum { CLOCK, TRUTH, INSTANCES, CHANNELS } kind_t;

typedef struct {
    kind_t kind;
    uint32_t topic;
    uint32_t every;
    const fcsl_ros_composer_t *composer;
    uint8_t *head; /* TRUTH */
    uint32_t head_size;
    uint32_t size; /* of each message */
    uint32_t *numbers; /* of instances, or channels */
    uint32_t count;
} topic_t;

struct fcsl_sim_topics {
    fcsl_publish_queue_t *queue;
    topic_t *topics;
    uint32_t count;
    uint8_t *scratch; /* the longest message */
    uint32_t scratch_size;
    const uint8_t **memories; /* as many as there are instances */
    double *values; /* all of the truth */
};

void fcsl_sim_topics_free(fcsl_sim_t *sim)
{
    struct fcsl_sim_topics *all = sim->topics;
    if (!all) {
        return;
    }
    for (uint32_t i = 0; i < all->count; i++) {
        free(all->topics[i].head);
        free(all->topics[i].numbers);
    }
    free(all->topics);
    free(all->scratch);
    free((void *)all->memories);
    free(all->values);
    free(all);
}

static int no_memory(topic_t *topic, fcsl_error_t *error)
{
    free(topic->head);
    free(topic->numbers);
    return fcsl_fail(error, "no memory for a topic");
}

/* Owns what the topic points to, also when it fails. */
static int add(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, topic_t *topic, fcsl_error_t *error)
{
    if (!sim->topics) {
        sim->topics = calloc(1, sizeof *sim->topics);
    }
    struct fcsl_sim_topics *all = sim->topics;
    if (all && !all->memories) {
        all->memories = calloc(sim->plant.instance_count + 1u, sizeof *all->memories);
        all->values = calloc(fcsl_sim_truth_values(sim, NULL, 0) + 1u, sizeof *all->values);
    }
    topic_t *topics =
        all && all->memories && all->values ? realloc(all->topics, (all->count + 1u) * sizeof *topics) : NULL;
    if (!topics) {
        return no_memory(topic, error);
    }
    all->topics = topics;
    if (topic->size > all->scratch_size) {
        uint8_t *scratch = realloc(all->scratch, topic->size);
        if (!scratch) {
            return no_memory(topic, error);
        }
        all->scratch = scratch;
        all->scratch_size = topic->size;
    }
    all->queue = queue;
    topics[all->count++] = *topic;
    return 0;
}

static uint32_t *copy_numbers(const uint32_t *numbers, uint32_t count)
{
    uint32_t *copy = calloc(count + 1u, sizeof *copy);
    if (copy) {
        memcpy(copy, numbers, count * sizeof *copy);
    }
    return copy;
}

int fcsl_sim_show_clock(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t number, fcsl_error_t *error)
{
    topic_t topic = {.kind = CLOCK, .topic = number, .every = 1, .size = CLOCK_BYTES};
    return add(sim, queue, &topic, error);
}

int fcsl_sim_show_truth(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t number, const uint8_t *head,
                        uint32_t head_size, uint32_t every, fcsl_error_t *error)
{
    const uint32_t values = fcsl_sim_truth_values(sim, NULL, 0);
    topic_t topic = {.kind = TRUTH,
                     .topic = number,
                     .every = every,
                     .head_size = head_size,
                     .size = head_size + values * (uint32_t)sizeof(double),
                     .head = malloc(head_size)};
    if (!topic.head || head_size < TICK_AT + 8u || head_size % 4u != 0 || every == 0) {
        return no_memory(&topic, error);
    }
    memcpy(topic.head, head, head_size);
    return add(sim, queue, &topic, error);
}

int fcsl_sim_show_instances(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t number,
                            const fcsl_ros_composer_t *composer, uint32_t size, const uint32_t *instances,
                            uint32_t count, uint32_t every, fcsl_error_t *error)
{
    topic_t topic = {.kind = INSTANCES,
                     .topic = number,
                     .every = every,
                     .composer = composer,
                     .size = size,
                     .numbers = copy_numbers(instances, count),
                     .count = count};
    int valid = topic.numbers && every > 0 && count <= sim->plant.instance_count;
    for (uint32_t i = 0; valid && i < count; i++) {
        valid = instances[i] < sim->plant.instance_count;
    }
    return valid ? add(sim, queue, &topic, error) : no_memory(&topic, error);
}

int fcsl_sim_show_channels(fcsl_sim_t *sim, fcsl_publish_queue_t *queue, uint32_t number,
                           const fcsl_ros_composer_t *composer, uint32_t size, const uint32_t *channels, uint32_t count,
                           fcsl_error_t *error)
{
    topic_t topic = {.kind = CHANNELS,
                     .topic = number,
                     .every = 1,
                     .composer = composer,
                     .size = size,
                     .numbers = copy_numbers(channels, count),
                     .count = count};
    return topic.numbers ? add(sim, queue, &topic, error) : no_memory(&topic, error);
}

/* ---- a tick --------------------------------------------------------------------------------------------------------------- */

static void put_stamp(uint8_t *at, int64_t time_ns)
{
    fcsl_put_u32(at, (uint32_t)(time_ns / FCSL_NS_PER_S));
    fcsl_put_u32(at + 4, (uint32_t)(time_ns % FCSL_NS_PER_S));
}

static void make_truth(const fcsl_sim_t *sim, const topic_t *topic, uint8_t *bytes)
{
    const uint32_t values = (topic->size - topic->head_size) / (uint32_t)sizeof(double);
    memcpy(bytes, topic->head, topic->head_size);
    put_stamp(bytes + STAMP_AT, sim->plant.time_ns);
    fcsl_put_u64(bytes + TICK_AT, sim->tick);
    /* The encapsulation moves doubles of a message out of line: they are made elsewhere. */
    double *made = sim->topics->values;
    (void)fcsl_sim_truth_values(sim, made, values);
    memcpy(bytes + topic->head_size, made, values * sizeof *made);
}

static int is_sampled(const fcsl_sim_t *sim, const topic_t *topic)
{
    for (uint32_t i = 0; i < topic->count; i++) {
        if (fcsl_sim_sampled(sim, topic->numbers[i])) {
            return 1;
        }
    }
    return 0;
}

/* Writes the message of this tick, of `size` bytes; 0 when there is none. */
static int make(const fcsl_sim_t *sim, const topic_t *topic, uint8_t *bytes, uint32_t *size)
{
    const uint8_t **memories = sim->topics->memories;
    *size = topic->size;
    switch (topic->kind) {
    case CLOCK:
        memcpy(bytes, "\0\1\0\0", STAMP_AT);
        put_stamp(bytes + STAMP_AT, sim->plant.time_ns);
        return 1;
    case TRUTH:
        make_truth(sim, topic, bytes);
        return 1;
    case INSTANCES:
        for (uint32_t i = 0; i < topic->count; i++) {
            memories[i] = sim->plant.instances[topic->numbers[i]].data;
        }
        return fcsl_ros_compose(topic->composer, memories, sim->plant.time_ns, bytes, size) == FCSL_ROS_TAKEN;
    default:
        memories[0] = sim->image;
        return is_sampled(sim, topic) &&
               fcsl_ros_compose(topic->composer, memories, sim->plant.time_ns, bytes, size) == FCSL_ROS_TAKEN;
    }
}

void fcsl_sim_topics_put(fcsl_sim_t *sim)
{
    struct fcsl_sim_topics *all = sim->topics;
    for (uint32_t i = 0; all && i < all->count; i++) {
        const topic_t *topic = &all->topics[i];
        uint32_t size = 0;
        if (sim->tick % topic->every != 0 || !make(sim, topic, all->scratch, &size)) {
            continue;
        }
        uint8_t *place = fcsl_publish_queue_claim(all->queue, topic->topic, size, FCSL_PUBLISH_QUEUE_STREAM);
        if (place) {
            memcpy(place, all->scratch, size);
            fcsl_publish_queue_put(all->queue);
        }
    }
}

void fcsl_sim_topics_wake(const fcsl_sim_t *sim)
{
    if (sim->topics) {
        fcsl_publish_queue_wake(sim->topics->queue);
    }
}
