/* SPDX-License-Identifier: Apache-2.0
 *
 * Copies the state of the plant out and in. Both directions walk over the same parts in the same order.
 */
#include "plant_state.h"

#include <string.h>

#include "actuators.h"
#include "clock.h"

typedef enum { COUNT, SAVE, RESTORE } direction_t;

typedef struct {
    direction_t direction;
    uint8_t *at;
    size_t bytes;
} walk_t;

static void part(walk_t *walk, void *data, size_t size)
{
    if (walk->direction == SAVE) {
        memcpy(walk->at + walk->bytes, data, size);
    } else if (walk->direction == RESTORE) {
        memcpy(data, walk->at + walk->bytes, size);
    }
    walk->bytes += size;
}

static void walk_group(walk_t *walk, fcsl_sim_t *sim, fcsl_group_t *group)
{
    fcsl_group_state_t state = group->state;
    if (walk->direction == SAVE) {
        fcsl_group_save(group, &state, sim->group_scratch);
    }
    part(walk, &state, sizeof state);
    part(walk, sim->group_scratch, fcsl_group_saved(group) * sizeof *sim->group_scratch);
    if (walk->direction == RESTORE) {
        fcsl_group_restore(group, &state, sim->group_scratch);
    }
}

static void walk_link(walk_t *walk, fcsl_sim_t *sim)
{
    uint8_t *at = walk->at + walk->bytes;
    if (sim->link && walk->direction == SAVE) {
        fcsl_sim_link_save(sim->link, at);
    } else if (sim->link && walk->direction == RESTORE) {
        fcsl_sim_link_restore(sim->link, at);
    }
    walk->bytes += sim->link ? fcsl_sim_link_bytes(sim->link) : 0u;
}

static void walk_all(walk_t *walk, fcsl_sim_t *sim)
{
    part(walk, &sim->tick, sizeof sim->tick);
    part(walk, &sim->time_ns, sizeof sim->time_ns);
    part(walk, &sim->until_held, sizeof sim->until_held);
    part(walk, &sim->next_event, sizeof sim->next_event);
    part(walk, sim->image, sim->machine->size);
    part(walk, &sim->gate.command_ns, sizeof sim->gate.command_ns);
    part(walk, &sim->gate.state, sizeof sim->gate.state);
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        part(walk, instance->data, instance->model->size);
        part(walk, &instance->noise, sizeof instance->noise);
        part(walk, &instance->next_update, sizeof instance->next_update);
    }
    for (uint32_t i = 0; i < sim->group_count; i++) {
        walk_group(walk, sim, &sim->groups[i]);
    }
    walk_link(walk, sim);
}

size_t fcsl_plant_state_bytes(const fcsl_sim_t *sim)
{
    walk_t walk = {.direction = COUNT};
    walk_all(&walk, (fcsl_sim_t *)(uintptr_t)sim); /* counts only */
    return walk.bytes;
}

void fcsl_plant_state_save(const fcsl_sim_t *sim, void *bytes)
{
    walk_t walk = {.direction = SAVE, .at = bytes};
    walk_all(&walk, (fcsl_sim_t *)(uintptr_t)sim); /* writes only to `bytes` and to the scratch */
}

void fcsl_plant_state_restore(fcsl_sim_t *sim, const void *bytes)
{
    walk_t walk = {.direction = RESTORE, .at = (uint8_t *)(uintptr_t)bytes}; /* reads only */
    walk_all(&walk, sim);
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->instances[i];
        instance->next_update_ns =
            instance->hz > 0 ? fcsl_grid_time_ns(instance->next_update, instance->hz) : INT64_MAX;
        instance->due = 0;
        instance->fresh = 0;
    }
    fcsl_sim_refill_queue(sim);
    fcsl_actuators_update(sim);
    fcsl_sim_pace_anew(sim);
}
