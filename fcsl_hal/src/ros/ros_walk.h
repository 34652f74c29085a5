/* SPDX-License-Identifier: Apache-2.0
 *
 * The walk through the bytes of a message, which come from anywhere.
 */
#ifndef FCSL_ROS_WALK_H
#define FCSL_ROS_WALK_H

#include "fcsl/fcsl_ros.h"

enum {
    FCSL_ROS_PARTS_MAX = 1 << 16,
    FCSL_ROS_ANCHORS_MAX = 1024,
    FCSL_ROS_NAMES_MAX = 256,
    FCSL_ROS_DEPTH_MAX = 16, /* sequences of messages inside one another */
    FCSL_ROS_ENCAPSULATION_BYTES = 4
};

/* What a walk found. */
typedef struct {
    const uint8_t *anchors[FCSL_ROS_ANCHORS_MAX]; /* null: not in this message */
    uint32_t lengths[FCSL_ROS_ANCHORS_MAX];       /* numbers behind the anchor of a sequence that may be shorter */
    uint32_t indices[FCSL_ROS_ANCHORS_MAX];       /* what the anchor of a CHOICE points to */
    uint32_t found[FCSL_ROS_NAMES_MAX];           /* index of each name in its NAMES, or FCSL_ROS_NONE */
    size_t end;                                   /* bytes that the message's type took */
} fcsl_ros_walk_t;

/* Whether the parts of a conversion lead through a message: known codes, loops that nest, tables that are there. */
int fcsl_ros_walk_valid(const fcsl_ros_reader_plan_t *conversion);

/* Whether a pick is of a sequence that may be shorter; whether it is the length of one. */
int fcsl_ros_pick_is_limited(const fcsl_ros_pick_t *pick);
int fcsl_ros_pick_is_length(const fcsl_ros_pick_t *pick);

/* Walks all of a message. FCSL_ROS_TAKEN, or what is wrong with it. Bytes behind the message are no mistake: DDS pads to whole
 * words, and rclpy's serialize_message leaves some behind sequences that are empty. */
fcsl_ros_status_t fcsl_ros_walk(const fcsl_ros_reader_plan_t *conversion, fcsl_ros_walk_t *walk, const uint8_t *cdr,
                                size_t size);

#endif /* FCSL_ROS_WALK_H */
