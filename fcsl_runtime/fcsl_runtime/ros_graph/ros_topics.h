/* SPDX-License-Identifier: Apache-2.0
 *
 * The topics of a machine in a ROS 2 graph: endpoint, messages of a tick.
 */
#ifndef FCSL_ROS_GRAPH_ROS_TOPICS_H
#define FCSL_ROS_GRAPH_ROS_TOPICS_H

#include <stdatomic.h>

#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_ros_graph.h"
#include "endpoint.h"
#include "messages/message.h"
#include "messages/tick_messages.h"
#include "observers/history_reader.h"

typedef enum { ROS_TICK_MESSAGE, ROS_INSTANCE, ROS_CLOCK, ROS_MAPPED, ROS_EVENTS } ros_topic_kind_t;

typedef struct {
    ros_topic_kind_t kind;
    int latched;              /* of a ROS_TICK_MESSAGE: written when it differs from the last one */
    fcsl_tick_message_t what; /* ROS_TICK_MESSAGE */
    fcsl_layout_t layout;     /* ROS_INSTANCE */
    const fcsl_ros_message_t *mapped; /* ROS_MAPPED */
    fcsl_ros_composer_t *composer;
    uint32_t most;            /* messages of a tick */
    uint64_t next_event;      /* ROS_EVENTS: that was not written */
    uint32_t longest;         /* bytes of the longest message */
    uint32_t last_message_bytes;      /* of the last one */
    uint8_t *last_message;
    ros_endpoint_t endpoint;
} ros_topic_t;

typedef struct {
    const fcsl_run_t *run;
    const fcsl_machine_t *machine; /* of it */
    ros_place_t place; /* in the graph */
    const uint8_t *safe; /* its struct with safe values, or null */
    ros_topic_t *topics; /* the latched ones first */
    uint32_t count;
    uint32_t latched_count;
    _Atomic uint64_t refused; /* messages that were not made, because a value does not fit its field */
} ros_topics_t;

/* Returns 0, or -1 with `error`; free it either way. */
int ros_topics_build(ros_topics_t *topics, const fcsl_ros_graph_options_t *options, fcsl_error_t *error);
void ros_topics_free(ros_topics_t *topics);

/* Writes a topic's message of a tick, or the next one of its events. Returns its bytes, or 0 when there is none. `bytes` has room for the
 * topic's longest. */
size_t ros_topics_write(ros_topics_t *topics, uint32_t number, const published_tick_t *tick, fcsl_stamp_t stamp,
                        uint8_t *bytes);

/* What was written last was not put: it is written again with the next tick. */
void ros_topics_unsay(ros_topics_t *topics, uint32_t number);
/* Nobody subscribes: events so far are not written. */
void ros_topics_skip(ros_topics_t *topics, uint32_t number);

#endif /* FCSL_ROS_GRAPH_ROS_TOPICS_H */
