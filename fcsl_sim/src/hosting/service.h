/* SPDX-License-Identifier: Apache-2.0
 *
 * What a simulation with a variable server has besides.
 */
#ifndef FCSL_SIM_SERVICE_H
#define FCSL_SIM_SERVICE_H

#include "fcsl/fcsl_vars.h"
#include "checkpoints/snapshot.h"

struct fcsl_sim_service {
    fcsl_vars_t *vars;
    fcsl_sim_snapshot_t *snapshot;
    fcsl_tick_stats_t stats;
};

#endif /* FCSL_SIM_SERVICE_H */
