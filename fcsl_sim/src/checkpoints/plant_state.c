/* SPDX-License-Identifier: Apache-2.0
 *
 * Copies the state of the plant out and in. Both directions walk over the same parts in the same order.
 */
#include "plant_state.h"

#include <string.h>

#include "base/clock.h"
#include "engine/actuators.h"
#include "engine/instants.h"
#include "engine/tick_pacing.h"

typedef enum { COUNT, SAVE, RESTORE } direction_t;

typedef struct {
    direction_t direction;
    uint8_t *at;
    size_t bytes;
    size_t end;      /* of what is restored */
    int structs_alone; /* the machines of companions have no memory of requirements: format version 1 of checkpoints */
    int failed; /* a machine has refused what it got, or there was too little */
} walk_t;

static void part(walk_t *walk, void *data, size_t size)
{
    if (walk->direction == SAVE) {
        memcpy(walk->at + walk->bytes, data, size);
    } else if (walk->direction == RESTORE && walk->end - walk->bytes < size) {
        walk->failed = 1;
        return;
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
    if (!sim->link) {
        return;
    }
    if (walk->direction == SAVE) {
        fcsl_sim_link_save(sim->link, walk->at + walk->bytes);
    } else if (walk->direction == RESTORE && !walk->failed) {
        fcsl_sim_link_restore(sim->link, walk->at + walk->bytes);
    }
    walk->bytes += fcsl_sim_link_bytes(sim->link);
}

static void walk_sensors(walk_t *walk, fcsl_sensor_t *sensors, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        part(walk, &sensors[i].samples, sizeof sensors[i].samples);
    }
}

/* The machine of a companion is restored as a host restores it, so that a bag shows it. */
static void walk_companion(walk_t *walk, fcsl_companion_t *companion)
{
    const uint32_t size = companion->machine->size;
    part(walk, &companion->tick, sizeof companion->tick);
    part(walk, companion->image, size);
    part(walk, &companion->gate.command_ns, sizeof companion->gate.command_ns);
    part(walk, &companion->gate.state, sizeof companion->gate.state);
    walk_sensors(walk, companion->sensors, companion->sensor_count);
    part(walk, companion->delay.slots, fcsl_delay_bytes(&companion->delay));
    part(walk, fcsl_run_simulated_hardware(companion->run), sizeof(fcsl_hw_sim_t));
    uint32_t saved = walk->structs_alone ? size : fcsl_run_save_bytes(companion->run);
    if (!walk->structs_alone) {
        part(walk, &saved, sizeof saved);
    }
    fcsl_error_t error;
    if (walk->direction == SAVE) {
        (void)fcsl_run_save(companion->run, walk->at + walk->bytes, saved, &error); /* the size is right */
    } else if (walk->direction == RESTORE) {
        walk->failed = walk->failed || walk->end - walk->bytes < saved ||
                       fcsl_run_restore(companion->run, walk->at + walk->bytes, saved, &error) != 0;
        companion->next_tick_ns = fcsl_grid_time_ns(companion->tick, companion->machine->tick_hz);
        companion->due = 0;
    }
    walk->bytes += walk->failed ? 0 : saved;
}

static void walk_all(walk_t *walk, fcsl_sim_t *sim)
{
    part(walk, &sim->tick, sizeof sim->tick);
    part(walk, &sim->plant.time_ns, sizeof sim->plant.time_ns);
    part(walk, &sim->until_held, sizeof sim->until_held);
    part(walk, sim->image, sim->machine->size);
    part(walk, &sim->gate.command_ns, sizeof sim->gate.command_ns);
    part(walk, &sim->gate.state, sizeof sim->gate.state);
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        part(walk, instance->data, instance->model->size);
        part(walk, &instance->noise, sizeof instance->noise);
        part(walk, &instance->next_update, sizeof instance->next_update);
        part(walk, &instance->samples, sizeof instance->samples);
    }
    walk_sensors(walk, sim->sensors, sim->sensor_count);
    part(walk, sim->delay.slots, fcsl_delay_bytes(&sim->delay));
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        walk_companion(walk, &sim->companions[i]);
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

/* What was scheduled until now has happened, or belongs to another simulation than the one that saved. */
static void pass_events(fcsl_sim_t *sim)
{
    sim->next_event = 0;
    while (sim->tick > 0 && sim->next_event < sim->plan.event_count &&
           (int64_t)sim->plan.events[sim->event_order[sim->next_event]].time_ns <= sim->plant.time_ns) {
        sim->next_event++;
    }
}

int fcsl_plant_state_restore(fcsl_sim_t *sim, const void *bytes, size_t size, int structs_alone)
{
    walk_t walk = {.direction = RESTORE,
                   .at = (uint8_t *)(uintptr_t)bytes, /* reads only */
                   .end = size,
                   .structs_alone = structs_alone};
    walk_all(&walk, sim);
    if (walk.failed || walk.bytes != size) {
        return -1;
    }
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        instance->next_update_ns =
            instance->hz > 0 ? fcsl_grid_time_ns(instance->next_update, instance->hz) : INT64_MAX;
        instance->due = 0;
    }
    pass_events(sim);
    for (uint32_t i = 0; i < sim->group_count; i++) {
        sim->groups[i].next_write = 0;
    }
    fcsl_sim_refill_queue(sim);
    fcsl_actuators_update(sim);
    fcsl_sim_pace_anew(sim);
    return 0;
}
