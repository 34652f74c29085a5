/* SPDX-License-Identifier: Apache-2.0
 *
 * The data that the simulation publishes to other threads: the memory of the hosted machine and of every model after the
 * last ticks, and the tables that describe it.
 */
#ifndef FCSL_SIM_PUBLISH_H
#define FCSL_SIM_PUBLISH_H

#include "fcsl/fcsl_vars.h"
#include "engine/simulation.h"

struct fcsl_sim_published {
    fcsl_history_t history;
    /* The machine, if it is hosted here, the instances, what the actuators get, the verdicts on the machine's requirements. */
    fcsl_vars_block_t *blocks;
    fcsl_part_t *parts;
    uint32_t count;
    uint32_t instance_count;
    uint32_t first_model;  /* block of instance 0 */
    fcsl_field_t **fields; /* per instance: the model's table, with write access for clients */
    const char ***writers; /* per instance and field */
    char **texts;          /* per instance: the strings of `writers` */
};

/* Creates sim->published, if it does not exist, and publishes; only before the first tick. */
int fcsl_sim_publish_begin(fcsl_sim_t *sim, fcsl_error_t *error);

/* Publishes the current values to clients, telemetry and observers. */
void fcsl_sim_publish(fcsl_sim_t *sim);
void fcsl_sim_publish_end(fcsl_sim_t *sim);

#endif /* FCSL_SIM_PUBLISH_H */
