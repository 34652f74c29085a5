/* SPDX-License-Identifier: Apache-2.0
 *
 * A publisher or subscription as zenoh-plugin-ros2dds sees it: its key, and the liveliness token that announces it.
 */
#ifndef FCSL_ROS_GRAPH_ENDPOINT_H
#define FCSL_ROS_GRAPH_ENDPOINT_H

#include "fcsl/fcsl_bus.h"
#include "fcsl/fcsl_run.h"

typedef enum { ROS_PUBLISHER, ROS_SUBSCRIPTION } ros_endpoint_kind_t;

typedef struct {
    ros_endpoint_kind_t kind;
    const char *type; /* "pkg/msg/Name" */
    const char *hash; /* "RIHS01_…" */
    int reliable;
    int latched; /* transient local */
    unsigned depth;
} ros_quality_t;

/* The key of topic `name` ("imu/data"; "/clock" is outside of the namespace), behind `machine` if that is not null. The namespace
 * may have slashes around it. Returns 0, or -1 with `error`. */
int ros_key_write(char key[FCSL_BUS_KEY_MAX + 1], const char *name_space, const char *machine, const char *name,
                  fcsl_error_t *error);

/* The token of an endpoint of the topic with that key. */
int ros_token_write(char token[FCSL_BUS_TOKEN_MAX + 1], const char *key, const ros_quality_t *quality,
                    fcsl_error_t *error);

#endif /* FCSL_ROS_GRAPH_ENDPOINT_H */
