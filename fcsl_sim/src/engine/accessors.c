/* SPDX-License-Identifier: Apache-2.0
 *
 * Values of a simulation between two ticks, and writes to them.
 */
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "instants.h"

/* ---- further controllers ------------------------------------------------------------------------------------------------ */

uint32_t fcsl_sim_companion_count(const fcsl_sim_t *sim)
{
    return sim->companion_count;
}

const char *fcsl_sim_companion_name(const fcsl_sim_t *sim, uint32_t companion)
{
    return companion < sim->companion_count ? sim->companions[companion].name : NULL;
}

fcsl_run_t *fcsl_sim_companion(fcsl_sim_t *sim, uint32_t companion)
{
    return companion < sim->companion_count ? sim->companions[companion].run : NULL;
}

const char *fcsl_sim_companion_state(const fcsl_sim_t *sim, uint32_t companion, uint64_t *ticks)
{
    if (companion >= sim->companion_count) {
        return NULL;
    }
    const fcsl_companion_t *found = &sim->companions[companion];
    int32_t state = 0;
    memcpy(&state, (const uint8_t *)fcsl_run_data(found->run) + found->machine->state_offset, sizeof state);
    *ticks = found->tick;
    return found->machine->states[state].name; /* within the table: a run holds no other */
}

/* ---- writing ------------------------------------------------------------------------------------------------------------- */

fcsl_run_t *fcsl_sim_hosted(fcsl_sim_t *sim)
{
    return sim->run;
}

int fcsl_sim_write(fcsl_sim_t *sim, uint32_t instance, uint32_t offset, const void *bytes, uint32_t size,
                   fcsl_error_t *error)
{
    if (sim->sensed || instance >= sim->plant.instance_count || offset > sim->plant.instances[instance].model->size ||
        size > sim->plant.instances[instance].model->size - offset) {
        return fcsl_fail(error, "a write that is not between two ticks, or not within an instance");
    }
    uint8_t *to = sim->plant.instances[instance].data + offset;
    if (memcmp(to, bytes, size) != 0) {
        memcpy(to, bytes, size);
        fcsl_sim_disturb(sim, instance);
    }
    return 0;
}

/* ---- reading ------------------------------------------------------------------------------------------------------------- */

const fcsl_machine_t *fcsl_sim_machine(const fcsl_sim_t *sim)
{
    return sim->machine;
}

int64_t fcsl_sim_time_ns(const fcsl_sim_t *sim)
{
    return sim->plant.time_ns;
}

uint64_t fcsl_sim_tick(const fcsl_sim_t *sim)
{
    return sim->tick;
}

uint64_t fcsl_sim_ticks(const fcsl_sim_t *sim)
{
    return sim->plan.ticks;
}

fcsl_sim_status_t fcsl_sim_status(const fcsl_sim_t *sim)
{
    return sim->status;
}

size_t fcsl_sim_message_capacity(const fcsl_sim_t *sim)
{
    return sim->message_capacity;
}

uint32_t fcsl_sim_instance_count(const fcsl_sim_t *sim)
{
    return sim->plant.instance_count;
}

const char *fcsl_sim_instance_name(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].name : NULL;
}

const fcsl_model_t *fcsl_sim_instance_model(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].model : NULL;
}

const void *fcsl_sim_channel_data(const fcsl_sim_t *sim)
{
    return sim->image;
}

int fcsl_sim_sampled(const fcsl_sim_t *sim, uint32_t channel)
{
    return channel < sim->machine->channel_count && sim->select[channel];
}

const void *fcsl_sim_instance_data(const fcsl_sim_t *sim, uint32_t instance)
{
    return instance < sim->plant.instance_count ? sim->plant.instances[instance].data : NULL;
}

const void *fcsl_sim_machine_data(const fcsl_sim_t *sim)
{
    return fcsl_run_data(sim->run);
}

int32_t fcsl_sim_state(const fcsl_sim_t *sim)
{
    int32_t state = 0;
    memcpy(&state, (const uint8_t *)fcsl_sim_machine_data(sim) + sim->machine->state_offset, sizeof state);
    return state;
}
