/* SPDX-License-Identifier: Apache-2.0
 *
 * Takes and restores the whole state of a simulation.
 */
#include "snapshot.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "actuators.h"
#include "fail.h"
#include "fcsl/fcsl_scalar.h"

struct fcsl_sim_snapshot {
    int is; /* a snapshot was saved */
    uint8_t *machine;
    uint8_t *image;
    fcsl_gate_t gate;
    uint8_t *models; /* their structs, concatenated */
    uint8_t *link;   /* null: there is none */
    fcsl_noise_t *noises;
    fcsl_event_t *events;
    uint32_t event_count;
    uint64_t next_sequence;
    fcsl_hw_sim_t hardware;
    uint64_t until_held;
    uint64_t tick;
    int64_t time_ns;
};

fcsl_sim_snapshot_t *fcsl_sim_snapshot_open(const fcsl_sim_t *sim)
{
    fcsl_sim_snapshot_t *snapshot = calloc(1, sizeof *snapshot);
    if (!snapshot) {
        return NULL;
    }
    size_t models = 1;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        models += sim->instances[i].model->size;
    }
    snapshot->machine = malloc(sim->machine->size);
    snapshot->image = malloc(sim->machine->size);
    snapshot->models = malloc(models);
    snapshot->link = sim->link ? malloc(fcsl_sim_link_bytes(sim->link)) : NULL;
    snapshot->noises = calloc(sim->instance_count + 1u, sizeof *snapshot->noises);
    snapshot->events = calloc(sim->queue.capacity, sizeof *snapshot->events);
    if (!snapshot->machine || !snapshot->image || !snapshot->models || !snapshot->noises || !snapshot->events ||
        (sim->link && !snapshot->link)) {
        fcsl_sim_snapshot_free(snapshot);
        return NULL;
    }
    return snapshot;
}

void fcsl_sim_snapshot_free(fcsl_sim_snapshot_t *snapshot)
{
    if (snapshot) {
        free(snapshot->machine);
        free(snapshot->image);
        free(snapshot->models);
        free(snapshot->link);
        free(snapshot->noises);
        free(snapshot->events);
        free(snapshot);
    }
}

void fcsl_sim_snapshot_take(const fcsl_sim_t *sim, fcsl_sim_snapshot_t *snapshot)
{
    memcpy(snapshot->machine, fcsl_run_data(sim->run), sim->machine->size);
    memcpy(snapshot->image, sim->image, sim->machine->size);
    snapshot->gate = sim->gate;
    uint8_t *at = snapshot->models;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->instances[i];
        memcpy(at, instance->data, instance->model->size);
        at += instance->model->size;
        snapshot->noises[i] = instance->noise;
    }
    if (sim->link) {
        fcsl_sim_link_save(sim->link, snapshot->link);
    }
    memcpy(snapshot->events, sim->queue.events, sim->queue.count * sizeof *snapshot->events);
    snapshot->event_count = sim->queue.count;
    snapshot->next_sequence = sim->queue.next_sequence;
    snapshot->hardware = *fcsl_run_simulated_hardware(sim->run);
    snapshot->until_held = sim->until_held;
    snapshot->tick = sim->tick;
    snapshot->time_ns = sim->time_ns;
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
        return fcsl_sim_fail(error, "%s: only what this simulation has itself saved last can be restored", WHY), 0;
    }
    if (!same_machine(sim->machine, snapshot->machine, data) ||
        memcmp(&snapshot->hardware, hardware, sizeof *hardware) != 0) {
        return fcsl_sim_fail(error,
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
        fcsl_run_restore(sim->run, snapshot->machine, sim->machine->size, error)) {
        return -1;
    }
    *fcsl_run_simulated_hardware(sim->run) = snapshot->hardware;
    memcpy(sim->image, snapshot->image, sim->machine->size);
    sim->gate = snapshot->gate;
    fcsl_actuators_update(sim);
    const uint8_t *at = snapshot->models;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        memcpy(instance->data, at, instance->model->size);
        at += instance->model->size;
        instance->noise = snapshot->noises[i];
    }
    if (sim->link) {
        fcsl_sim_link_restore(sim->link, snapshot->link);
    }
    memcpy(sim->queue.events, snapshot->events, snapshot->event_count * sizeof *snapshot->events);
    sim->queue.count = snapshot->event_count;
    sim->queue.next_sequence = snapshot->next_sequence;
    sim->until_held = snapshot->until_held;
    sim->tick = snapshot->tick;
    sim->time_ns = snapshot->time_ns;
    fcsl_sim_pace_anew(sim);
    return 0;
}
