/* SPDX-License-Identifier: Apache-2.0 */
#include "kept.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fail.h"
#include "fcsl/fcsl_scalar.h"

struct fcsl_sim_kept {
    int is; /* something has been saved */
    uint8_t *machine;
    uint8_t *image;
    uint8_t *models; /* their structs, one behind the other */
    fcsl_noise_t *noises;
    fcsl_event_t *events;
    uint32_t event_count;
    uint64_t next_sequence;
    fcsl_hw_sim_t hardware;
    uint64_t until_held;
    uint64_t tick;
    int64_t time_ns;
};

fcsl_sim_kept_t *fcsl_sim_kept_open(const fcsl_sim_t *sim)
{
    fcsl_sim_kept_t *kept = calloc(1, sizeof *kept);
    if (!kept) {
        return NULL;
    }
    size_t models = 1;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        models += sim->instances[i].model->size;
    }
    kept->machine = malloc(sim->machine->size);
    kept->image = malloc(sim->machine->size);
    kept->models = malloc(models);
    kept->noises = calloc(sim->instance_count + 1u, sizeof *kept->noises);
    kept->events = calloc(sim->queue.capacity, sizeof *kept->events);
    if (!kept->machine || !kept->image || !kept->models || !kept->noises || !kept->events) {
        fcsl_sim_kept_free(kept);
        return NULL;
    }
    return kept;
}

void fcsl_sim_kept_free(fcsl_sim_kept_t *kept)
{
    if (kept) {
        free(kept->machine);
        free(kept->image);
        free(kept->models);
        free(kept->noises);
        free(kept->events);
        free(kept);
    }
}

void fcsl_sim_keep(const fcsl_sim_t *sim, fcsl_sim_kept_t *kept)
{
    memcpy(kept->machine, fcsl_run_data(sim->run), sim->machine->size);
    memcpy(kept->image, sim->image, sim->machine->size);
    uint8_t *at = kept->models;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->instances[i];
        memcpy(at, instance->data, instance->model->size);
        at += instance->model->size;
        kept->noises[i] = instance->noise;
    }
    memcpy(kept->events, sim->queue.events, sim->queue.count * sizeof *kept->events);
    kept->event_count = sim->queue.count;
    kept->next_sequence = sim->queue.next_sequence;
    kept->hardware = *fcsl_run_simulated_hardware(sim->run);
    kept->until_held = sim->until_held;
    kept->tick = sim->tick;
    kept->time_ns = sim->time_ns;
    kept->is = 1;
}

/* Whether all fields are the same; a NaN is one, whatever its bits. */
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

static int is_of_kept(const fcsl_sim_t *sim, const fcsl_sim_kept_t *kept, const void *data,
                      const fcsl_hw_sim_t *hardware, fcsl_error_t *error)
{
    static const char WHY[] =
        "a checkpoint holds the machine alone, not where its vehicle is nor what noise comes next";
    if (!kept->is) {
        return fcsl_sim_fail(error, "%s: only what this simulation has itself saved last can be restored", WHY), 0;
    }
    if (!same_machine(sim->machine, kept->machine, data) || memcmp(&kept->hardware, hardware, sizeof *hardware) != 0) {
        return fcsl_sim_fail(error,
                             "%s: only what this simulation has itself saved last, behind tick %" PRIu64
                             ", can be restored, and this is another one",
                             WHY, kept->tick),
               0;
    }
    return 1;
}

int fcsl_sim_put_back(fcsl_sim_t *sim, const fcsl_sim_kept_t *kept, const void *data, const fcsl_hw_sim_t *hardware,
                      fcsl_error_t *error)
{
    if (!is_of_kept(sim, kept, data, hardware, error) ||
        fcsl_run_restore(sim->run, kept->machine, sim->machine->size, error)) {
        return -1;
    }
    *fcsl_run_simulated_hardware(sim->run) = kept->hardware;
    memcpy(sim->image, kept->image, sim->machine->size);
    const uint8_t *at = kept->models;
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        memcpy(instance->data, at, instance->model->size);
        at += instance->model->size;
        instance->noise = kept->noises[i];
    }
    memcpy(sim->queue.events, kept->events, kept->event_count * sizeof *kept->events);
    sim->queue.count = kept->event_count;
    sim->queue.next_sequence = kept->next_sequence;
    sim->until_held = kept->until_held;
    sim->tick = kept->tick;
    sim->time_ns = kept->time_ns;
    fcsl_sim_pace_anew(sim);
    return 0;
}
