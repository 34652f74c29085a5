/* SPDX-License-Identifier: Apache-2.0
 *
 * The hosted machine in a ROS 2 graph, by a bridge (fcsl_ros_graph.h). Its thread reads the published data; no tick waits for it.
 */
#include "fcsl/fcsl_error.h"
#include "publish.h"

int fcsl_sim_ros(fcsl_sim_t *sim, const char *endpoint, const char *name_space, fcsl_error_t *error)
{
    if (sim->external) {
        return fcsl_fail(error, "with an external controller its topics are there: give `--ros` to it");
    }
    if (sim->ros || sim->service || sim->tick || sim->sensed) {
        return fcsl_fail(error, "ROS 2 topics come before variables are served and before the first tick");
    }
    if (fcsl_sim_publish_begin(sim, error)) {
        return -1;
    }
    const fcsl_ros_graph_options_t options = {
        .endpoint = endpoint, .name_space = name_space, .run = sim->run, .sensors = 1, .actuators = 1, .simulated = 1};
    sim->ros = fcsl_ros_graph_open(&options, &sim->published->history, error);
    return sim->ros ? fcsl_ros_graph_start(sim->ros, error) : -1;
}

void fcsl_sim_ros_stop(fcsl_sim_t *sim, fcsl_ros_graph_counters_t *counters)
{
    *counters = (fcsl_ros_graph_counters_t){0};
    if (sim->ros) {
        fcsl_ros_graph_stop(sim->ros);
        fcsl_ros_graph_count(sim->ros, counters);
    }
}
