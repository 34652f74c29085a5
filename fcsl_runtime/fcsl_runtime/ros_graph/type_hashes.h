/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_ROS_GRAPH_TYPE_HASHES_H
#define FCSL_ROS_GRAPH_TYPE_HASHES_H

/* "RIHS01_…" of a standard message ("sensor_msgs/msg/Imu"); null where it is none that a channel can be mapped to. */
const char *ros_type_hash(const char *type);

#endif /* FCSL_ROS_GRAPH_TYPE_HASHES_H */
