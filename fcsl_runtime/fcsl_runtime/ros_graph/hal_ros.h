/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_ROS_GRAPH_HAL_ROS_H
#define FCSL_ROS_GRAPH_HAL_ROS_H

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"

/* The HAL whose sensors and actuators are the mapped topics of a ROS 2 graph, by a bridge that connects to `endpoint`
 * (tcp:HOST:PORT), or with rmw_zenoh:tcp/HOST:PORT by the router there (docs/reference/transports.md). Each tick takes the newest message of each topic and writes its values into the run itself,
 * since they have an age and a stamp, which no message carries. Messages that are refused are counted by reason.
 *
 * Run, endpoint and namespace must outlive it. Returns 0, or -1 with `error`. */
int hal_ros(const char *endpoint, const char *name_space, fcsl_run_t *run, fcsl_hal_t *hal, fcsl_error_t *error);

#endif /* FCSL_ROS_GRAPH_HAL_ROS_H */
