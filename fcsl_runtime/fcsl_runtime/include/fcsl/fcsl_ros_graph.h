/* SPDX-License-Identifier: Apache-2.0
 *
 * A host's machine in a ROS 2 graph, without a ROS 2 library: CDR messages on the keys of zenoh-plugin-ros2dds or of
 * rmw_zenoh, over a session of the bus of its own (docs/reference/transports.md). Flight program and simulator serve it through this file.
 *
 * A thread reads the host's history and never meets the step thread; all memory is taken by open. Ticks that are overwritten
 * before there is room for them on the bus are dropped whole and counted. Messages of streams are made while somebody subscribes
 * to them.
 */
#ifndef FCSL_ROS_GRAPH_H
#define FCSL_ROS_GRAPH_H

#include "fcsl/fcsl_vars.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fcsl_ros_graph fcsl_ros_graph_t;

typedef struct {
    const char *
        endpoint; /* tcp:HOST:PORT, to listen on: a bridge of DDS connects there; or rmw_zenoh:tcp/HOST:PORT, a router */
    const char *name_space; /* of the topics, "" for none */
    const fcsl_run_t *run; /* its machine's struct is part 0 of the history */
    int sensors; /* with the topics of mapped sensor channels */
    int actuators; /* with those of actuators and reports */
    int simulated; /* time is the machine's own, and `clock` tells it; else stamps are ROS time, of the system's clock */
} fcsl_ros_graph_options_t;

/* Listens, or connects within some seconds, and declares all topics; nothing is put before fcsl_ros_graph_start. History and run must outlive it. Null with
 * `error`. */
fcsl_ros_graph_t *fcsl_ros_graph_open(const fcsl_ros_graph_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error);
int fcsl_ros_graph_start(fcsl_ros_graph_t *graph, fcsl_error_t *error);
/* Puts what the history still has, for a second at most, and ends the thread. The counters stay. Accepts null. */
void fcsl_ros_graph_stop(fcsl_ros_graph_t *graph);
/* Stops, too. Accepts null. */
void fcsl_ros_graph_close(fcsl_ros_graph_t *graph);

typedef struct {
    uint64_t ticks; /* whose messages were put */
    uint64_t dropped; /* whose messages were not, because there was no room in time */
    uint64_t refused; /* messages that were not made, because a value does not fit its field */
} fcsl_ros_graph_counters_t;

void fcsl_ros_graph_count(const fcsl_ros_graph_t *graph, fcsl_ros_graph_counters_t *counters);
/* The same as member `ros` of the reply to `stats`. */
void fcsl_ros_graph_stats(const fcsl_ros_graph_t *graph, fcsl_vars_out_t *out);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_ROS_GRAPH_H */
