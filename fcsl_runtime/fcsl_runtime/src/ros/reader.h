/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_ROS_READER_H
#define FCSL_ROS_READER_H

#include "fcsl/fcsl_ros.h"

/* The reader's own copy of its plan. */
const fcsl_ros_reader_plan_t *fcsl_ros_reader_plan(const fcsl_ros_reader_t *reader);

#endif /* FCSL_ROS_READER_H */
