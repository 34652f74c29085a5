/* SPDX-License-Identifier: Apache-2.0
 *
 * A snapshot of the last `save`: the hosted machine, and the plant, which a checkpoint of a machine does not include. A
 * client's checkpoint is only compared with it; no client data are copied into a model.
 */
#ifndef FCSL_SIM_SNAPSHOT_H
#define FCSL_SIM_SNAPSHOT_H

#include "engine/simulation.h"

typedef struct fcsl_sim_snapshot fcsl_sim_snapshot_t;

/* The only allocation. Null if there is no memory. */
fcsl_sim_snapshot_t *fcsl_sim_snapshot_open(const fcsl_sim_t *sim);
void fcsl_sim_snapshot_free(fcsl_sim_snapshot_t *snapshot);

/* Call both between two ticks only, when no sample is pending. */
void fcsl_sim_snapshot_take(const fcsl_sim_t *sim, fcsl_sim_snapshot_t *snapshot);
/* Restores the whole simulation to the saved moment, if `data` and `hardware` are its machine's. Returns 0, or -1 with
 * `error`: then nothing has changed, or the simulation cannot go on. */
int fcsl_sim_snapshot_restore(fcsl_sim_t *sim, const fcsl_sim_snapshot_t *snapshot, const void *data,
                              const fcsl_hw_sim_t *hardware, fcsl_error_t *error);

#endif /* FCSL_SIM_SNAPSHOT_H */
