/* SPDX-License-Identifier: Apache-2.0
 *
 * A publisher, subscription or service in a ROS 2 graph: its key on Zenoh, and the liveliness token that announces it, as the
 * middleware of the graph reads them; and the session that holds them.
 */
#ifndef FCSL_ROS_GRAPH_ENDPOINT_H
#define FCSL_ROS_GRAPH_ENDPOINT_H

#include "fcsl/fcsl_bus.h"

typedef enum {
    ROS_BY_BRIDGE, /* of DDS: zenoh-plugin-ros2dds connects to us */
    ROS_BY_RMW_ZENOH /* nodes of rmw_zenoh: we connect to their router */
} ros_middleware_t;

/* A graph, and this host in it. */
typedef struct {
    ros_middleware_t middleware;
    fcsl_bus_role_t role;
    const char *address;    /* of the session: tcp:HOST:PORT */
    const char *name_space; /* may have slashes around it, or be "" */
    const char *node;
    unsigned domain;
} ros_place_t;

typedef char ros_token_t[FCSL_BUS_TOKEN_MAX + 1];

typedef enum { ROS_PUBLISHER, ROS_SUBSCRIPTION, ROS_SERVICE } ros_endpoint_kind_t;

typedef struct {
    ros_endpoint_kind_t kind;
    const char *type; /* "pkg/msg/Name", "pkg/srv/Name" */
    const char *hash; /* "RIHS01_…" */
    int reliable;
    int latched; /* transient local */
    unsigned depth;
} ros_quality_t;

typedef struct {
    char key[FCSL_BUS_KEY_MAX + 1];
    ros_token_t token;
} ros_endpoint_t;

/* `address`: tcp:HOST:PORT to listen on for a bridge, or rmw_zenoh:tcp/HOST:PORT, whose domain is that of ROS_DOMAIN_ID, or 0.
 * The place keeps all three texts. Returns 0, or -1 with `error`. */
int ros_place_read(ros_place_t *place, const char *address, const char *name_space, const char *node,
                   fcsl_error_t *error);

/* The endpoint of topic or service `name` ("imu/data"; "/clock" is outside of the namespace), behind `machine` if that is not null. `number`: of it
 * in its session, from 0. Returns 0, or -1 with `error`. */
int ros_endpoint_write(ros_endpoint_t *endpoint, const ros_place_t *place, const char *machine, const char *name,
                       const ros_quality_t *quality, uint32_t number, fcsl_error_t *error);

/* Opens the graph's session with these tokens of endpoints; the array has room for one more, that of the node. What `options` says of
 * place and tokens is not looked at. Waits some seconds for a router. Returns 0, or -1 with `error`. */
int ros_session_open(const ros_place_t *place, const fcsl_bus_options_t *options, const char **tokens,
                     uint32_t token_count, fcsl_bus_t **bus, fcsl_error_t *error);

#endif /* FCSL_ROS_GRAPH_ENDPOINT_H */
