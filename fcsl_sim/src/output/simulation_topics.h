/* SPDX-License-Identifier: Apache-2.0
 *
 * The ROS 2 topics of a simulation.
 */
#ifndef FCSL_SIM_SIMULATION_TOPICS_H
#define FCSL_SIM_SIMULATION_TOPICS_H

#include "engine/simulation.h"

/* What the sensed tick shows, into the publish queue. */
void fcsl_sim_topics_put(fcsl_sim_t *sim);
/* Who takes from the publish queue looks at once. */
void fcsl_sim_topics_wake(const fcsl_sim_t *sim);
void fcsl_sim_topics_free(fcsl_sim_t *sim);

#endif /* FCSL_SIM_SIMULATION_TOPICS_H */
