/* SPDX-License-Identifier: Apache-2.0
 *
 * The ROS 2 topics of a run: after each tick, the messages that are due of them go into a publish queue. They are the same bytes that a
 * recording has, but for the stamp, which the host gives.
 *
 * Everything is added before the first tick. Nothing here allocates afterwards. Not thread-safe: they belong to who steps the run.
 */
#ifndef FCSL_TOPICS_H
#define FCSL_TOPICS_H

#include "fcsl/fcsl_publish_queue.h"
#include "fcsl/fcsl_ros.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_topics fcsl_topics_t;

/* Run and queue must outlive it. */
fcsl_topics_t *fcsl_topics_new(fcsl_run_t *run, fcsl_publish_queue_t *queue, fcsl_error_t *error);
void fcsl_topics_free(fcsl_topics_t *topics);

/* `topic`: its number in the publish queue. */
/* The generated message of an instance, of every `every`-th tick. */
int fcsl_topics_add_instance(fcsl_topics_t *topics, uint32_t topic, uint32_t instance, uint32_t every,
                             fcsl_error_t *error);
/* State, health and faults: where something changed. Transitions: each one. */
int fcsl_topics_add_tick_message(fcsl_topics_t *topics, uint32_t topic, fcsl_tick_message_t what, fcsl_error_t *error);
/* The events that the machine reports, each one, from now on. */
int fcsl_topics_add_events(fcsl_topics_t *topics, uint32_t topic, fcsl_error_t *error);
/* A message of actuator or of report channels, every tick; the composer must outlive the topics. */
int fcsl_topics_add_channels(fcsl_topics_t *topics, uint32_t topic, fcsl_direction_t direction,
                             const fcsl_ros_composer_t *composer, uint32_t size, fcsl_error_t *error);

/* What the last completed tick has to show, stamped `stamp_ns`. */
void fcsl_topics_put(fcsl_topics_t *topics, int64_t stamp_ns);
/* The same of state, health and faults alone, before the first tick, too. */
void fcsl_topics_put_changes(fcsl_topics_t *topics, int64_t stamp_ns);

/* Messages that were not made because a value does not fit its field. */
uint64_t fcsl_topics_refused(const fcsl_topics_t *topics, uint32_t topic);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_TOPICS_H */
