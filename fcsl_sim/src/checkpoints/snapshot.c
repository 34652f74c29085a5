/* SPDX-License-Identifier: Apache-2.0
 *
 * Takes and restores the whole state of a simulation.
 */
#include "snapshot.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_error.h"
#include "plant_state.h"

struct fcsl_sim_snapshot {
    int is; /* a snapshot was saved */
    uint8_t *machine; /* as fcsl_run_save gives it */
    uint8_t *plant;
    fcsl_hw_sim_t hardware;
    uint64_t tick;
};

fcsl_sim_snapshot_t *fcsl_sim_snapshot_open(const fcsl_sim_t *sim)
{
    fcsl_sim_snapshot_t *snapshot = calloc(1, sizeof *snapshot);
    if (!snapshot) {
        return NULL;
    }
    snapshot->machine = malloc(fcsl_run_save_bytes(sim->run));
    snapshot->plant = malloc(fcsl_plant_state_bytes(sim));
    if (!snapshot->machine || !snapshot->plant) {
        fcsl_sim_snapshot_free(snapshot);
        return NULL;
    }
    return snapshot;
}

void fcsl_sim_snapshot_free(fcsl_sim_snapshot_t *snapshot)
{
    if (snapshot) {
        free(snapshot->machine);
        free(snapshot->plant);
        free(snapshot);
    }
}

void fcsl_sim_snapshot_take(const fcsl_sim_t *sim, fcsl_sim_snapshot_t *snapshot)
{
    fcsl_error_t unused; /* the size is right */
    (void)fcsl_run_save(sim->run, snapshot->machine, fcsl_run_save_bytes(sim->run), &unused);
    fcsl_plant_state_save(sim, snapshot->plant);
    snapshot->hardware = *fcsl_run_simulated_hardware(sim->run);
    snapshot->tick = sim->tick;
    snapshot->is = 1;
}

/* Whether all fields are the same; all NaNs are equal. */
static int same_machine(const fcsl_machine_t *machine, const uint8_t *one, const uint8_t *other)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const uint32_t size = fcsl_scalar_size(field->type);
        for (uint32_t k = 0; k < field->count; k++) {
            uint8_t a[8] = {0};
            uint8_t b[8] = {0};
            const size_t at = field->offset + (size_t)k * size;
            fcsl_scalars_export(a, one + at, field->type, 1);
            fcsl_scalars_export(b, other + at, field->type, 1);
            if (memcmp(a, b, sizeof a) != 0) {
                return 0;
            }
        }
    }
    return 1;
}

static int is_of_snapshot(const fcsl_sim_t *sim, const fcsl_sim_snapshot_t *snapshot, const void *data,
                          const fcsl_hw_sim_t *hardware, fcsl_error_t *error)
{
    static const char WHY[] =
        "a checkpoint holds the machine alone, not where its vehicle is nor what noise comes next";
    if (!snapshot->is) {
        return fcsl_fail(error, "%s: only what this simulation has itself saved last can be restored", WHY), 0;
    }
    if (!same_machine(sim->machine, snapshot->machine, data) ||
        memcmp(&snapshot->hardware, hardware, sizeof *hardware) != 0) {
        return fcsl_fail(error,
                         "%s: only what this simulation has itself saved last, behind tick %" PRIu64
                         ", can be restored, and this is another one",
                         WHY, snapshot->tick),
               0;
    }
    return 1;
}

int fcsl_sim_snapshot_restore(fcsl_sim_t *sim, const fcsl_sim_snapshot_t *snapshot, const void *data,
                              const fcsl_hw_sim_t *hardware, fcsl_error_t *error)
{
    if (!is_of_snapshot(sim, snapshot, data, hardware, error) ||
        fcsl_run_restore(sim->run, snapshot->machine, fcsl_run_save_bytes(sim->run), error)) {
        return -1;
    }
    *fcsl_run_simulated_hardware(sim->run) = snapshot->hardware;
    sim->failed = fcsl_plant_state_restore(sim, snapshot->plant, fcsl_plant_state_bytes(sim), 0) != 0;
    return sim->failed ? fcsl_fail(error, "a machine does not take its state") : 0;
}
