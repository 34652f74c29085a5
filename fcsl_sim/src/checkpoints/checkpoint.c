/* SPDX-License-Identifier: Apache-2.0
 *
 * A checkpoint of a whole simulation as bytes, the content of its file. Numbers are little-endian:
 *
 *   FCSLSIMC, u32 version, u32 0, u64 bytes, u64 bytes of the machine's checkpoint, u64 bytes of the plant, u64 layout,
 *   the machine's checkpoint, the plant (plant_state.c, in the memory's byte order), u32 CRC-32 of all before it
 *
 * The layout is a hash of what gives the plant's bytes their meaning: models with their fields, groups and their integrators.
 */
#include <inttypes.h>
#include <string.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "fcsl/fcsl_scalar.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "output/publish.h"
#include "plant_state.h"

static const char MAGIC[8] = {'F', 'C', 'S', 'L', 'S', 'I', 'M', 'C'};
/* In the second version a companion has the size of its machine, and behind the struct what its requirements remember. */
enum { VERSION = 1, VERSION_WITH_MEMORY = 2, CRC_BYTES = 4 };
enum { AT_VERSION = 8, AT_BYTES = 16, AT_MACHINE = 24, AT_PLANT = 32, AT_LAYOUT = 40, HEAD_BYTES = 48 };

/* ---- layout ---------------------------------------------------------------------------------------------------------- */

/* FNV-1a, 64 bits. */
static void mix(uint64_t *hash, const void *bytes, size_t size)
{
    const uint8_t *at = bytes;
    for (size_t i = 0; i < size; i++) {
        *hash = (*hash ^ at[i]) * UINT64_C(0x100000001b3);
    }
}

static void mix_text(uint64_t *hash, const char *text)
{
    mix(hash, text, strlen(text) + 1u);
}

static void mix_number(uint64_t *hash, uint64_t number)
{
    mix(hash, &number, sizeof number);
}

static void mix_model(uint64_t *hash, const fcsl_model_t *model)
{
    mix_text(hash, model->name);
    mix_number(hash, model->size);
    mix_number(hash, model->continuous_offset);
    mix_number(hash, model->continuous_count);
    mix_number(hash, model->event_count);
    for (uint32_t i = 0; i < model->field_count; i++) {
        mix_text(hash, model->fields[i].path);
        mix_number(hash, model->fields[i].type);
        mix_number(hash, model->fields[i].offset);
        mix_number(hash, model->fields[i].count);
    }
}

static uint64_t layout_of(const fcsl_sim_t *sim)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    mix_number(&hash, sizeof(fcsl_group_state_t));
    mix_number(&hash, sizeof(fcsl_noise_t));
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[i];
        mix_text(&hash, instance->name);
        mix_model(&hash, instance->model);
        mix_number(&hash, instance->group);
        mix_number(&hash, instance->hz);
        mix_number(&hash, instance->every);
    }
    mix_number(&hash, sim->delay.ticks);
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        mix_text(&hash, sim->companions[i].name);
        mix_text(&hash, sim->companions[i].machine->layout_hash);
        mix_number(&hash, sim->companions[i].delay.ticks);
    }
    for (uint32_t i = 0; i < sim->group_count; i++) {
        mix_number(&hash, sim->groups[i].plan->method);
        mix_number(&hash, sim->groups[i].plan->hz);
        mix(&hash, &sim->groups[i].plan->rtol, sizeof sim->groups[i].plan->rtol);
        mix(&hash, &sim->groups[i].plan->min_step_s, sizeof sim->groups[i].plan->min_step_s);
        mix(&hash, &sim->groups[i].plan->max_step_s, sizeof sim->groups[i].plan->max_step_s);
        mix(&hash, sim->groups[i].atol, sim->groups[i].n * sizeof *sim->groups[i].atol);
    }
    for (uint32_t i = 0; i < sim->plant.copy_count; i++) {
        const fcsl_copy_t *copy = &sim->plant.copies[i];
        mix_number(&hash, copy->instance);
        mix_number(&hash, copy->source);
        mix_number(&hash, (uint64_t)(copy->to - sim->plant.instances[copy->instance].data));
        mix_number(&hash,
                   copy->source != UINT32_MAX ? (uint64_t)(copy->from - sim->plant.instances[copy->source].data) : 0u);
    }
    for (uint32_t i = 0; i < sim->sensor_count; i++) {
        mix_number(&hash, sim->sensors[i].instance);
        mix_number(&hash, sim->sensors[i].channel);
    }
    return hash;
}

/* ---- saving ------------------------------------------------------------------------------------------------------------ */

size_t fcsl_sim_checkpoint_capacity(const fcsl_sim_t *sim)
{
    return HEAD_BYTES + fcsl_run_checkpoint_capacity(sim->run) + fcsl_plant_state_bytes(sim) + CRC_BYTES;
}

size_t fcsl_sim_checkpoint(const fcsl_sim_t *sim, void *bytes)
{
    uint8_t *out = bytes;
    if (sim->link) {
        return 0;
    }
    const size_t machine = fcsl_run_checkpoint(sim->run, out + HEAD_BYTES);
    const size_t plant = fcsl_plant_state_bytes(sim);
    const size_t all = HEAD_BYTES + machine + plant + CRC_BYTES;
    memcpy(out, MAGIC, sizeof MAGIC);
    fcsl_put_u32(out + AT_VERSION, sim->companion_count > 0 ? VERSION_WITH_MEMORY : VERSION);
    fcsl_put_u32(out + AT_VERSION + 4, 0);
    fcsl_put_u64(out + AT_BYTES, all);
    fcsl_put_u64(out + AT_MACHINE, machine);
    fcsl_put_u64(out + AT_PLANT, plant);
    fcsl_put_u64(out + AT_LAYOUT, layout_of(sim));
    fcsl_plant_state_save(sim, out + HEAD_BYTES + machine);
    fcsl_put_u32(out + all - CRC_BYTES, fcsl_mcap_crc32(out, all - CRC_BYTES));
    return all;
}

/* ---- restoring --------------------------------------------------------------------------------------------------------- */

static int check_head(const fcsl_sim_t *sim, const uint8_t *in, size_t size, fcsl_error_t *error)
{
    if (size < sizeof MAGIC || memcmp(in, MAGIC, sizeof MAGIC) != 0) {
        return fcsl_fail(error, "not a checkpoint of a simulation: it does not begin with FCSLSIMC");
    }
    if (size < HEAD_BYTES + CRC_BYTES || fcsl_get_u64(in + AT_BYTES) != size) {
        return fcsl_fail(error, "cut short, or longer than it says");
    }
    const uint32_t version = fcsl_get_u32(in + AT_VERSION);
    if (version != VERSION && version != VERSION_WITH_MEMORY) {
        return fcsl_fail(error, "a checkpoint of format version %u, and this program reads versions %d and %d", version,
                         VERSION, VERSION_WITH_MEMORY);
    }
    if (fcsl_get_u32(in + size - CRC_BYTES) != fcsl_mcap_crc32(in, size - CRC_BYTES)) {
        return fcsl_fail(error, "damaged: its CRC-32 is wrong");
    }
    if (fcsl_get_u64(in + AT_LAYOUT) != layout_of(sim)) {
        return fcsl_fail(error, "of another simulation: its models, their fields, rates or integrators differ");
    }
    const uint64_t parts = size - HEAD_BYTES - CRC_BYTES;
    if (fcsl_get_u64(in + AT_PLANT) > parts || fcsl_get_u64(in + AT_MACHINE) != parts - fcsl_get_u64(in + AT_PLANT)) {
        return fcsl_fail(error, "damaged: the sizes of its parts are wrong");
    }
    return 0;
}

/* Whether the next update of an instance is the first one behind the present: PHASE + i * EVERY of its grid. */
static int is_update_possible(const fcsl_sim_t *sim, uint32_t index, int64_t now_ns)
{
    const fcsl_instance_state_t *instance = &sim->plant.instances[index];
    const uint64_t phase = sim->plan.instances[index].phase;
    const uint64_t next = instance->next_update;
    if (instance->hz == 0 || sim->tick == 0 || next == phase) {
        return next == phase && (instance->hz == 0 || sim->tick == 0 || fcsl_grid_time_ns(next, instance->hz) > now_ns);
    }
    if (next < phase || (next - phase) % instance->every != 0 ||
        next / instance->hz >= (uint64_t)INT64_MAX / FCSL_NS_PER_S) {
        return 0;
    }
    return fcsl_grid_time_ns(next, instance->hz) > now_ns &&
           fcsl_grid_time_ns(next - instance->every, instance->hz) <= now_ns;
}

static int is_group_possible(const fcsl_group_t *group, int64_t now_ns)
{
    const fcsl_group_state_t *state = &group->state;
    const uint64_t hz = group->plan->hz;
    const int events =
        state->last_event_ns >= 0 && state->last_event_ns <= now_ns && state->events_in_a_row < FCSL_CHATTER_EVENTS;
    if (state->time_ns != now_ns || state->from_ns > state->to_ns || state->to_ns > now_ns || state->event_ns != 0 ||
        !events || state->has_slope > 1 || state->kept >= FCSL_SLOPES || state->disturbed > 1) {
        return 0;
    }
    return hz == 0 || (state->begin_ns <= now_ns && state->end_ns > now_ns && state->step <= (uint64_t)now_ns &&
                       state->begin_ns == fcsl_grid_time_ns(state->step, hz) &&
                       state->end_ns == fcsl_grid_time_ns(state->step + 1u, hz) &&
                       state->carry == (state->step + 1u) % hz * FCSL_NS_PER_S % hz);
}

/* No bool of these fields holds another value than 0 and 1, which C has no meaning for. */
static int are_bools(const fcsl_field_t *fields, uint32_t count, const uint8_t *data)
{
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t k = 0; fields[i].type == FCSL_BOOL && k < fields[i].count; k++) {
            if (data[fields[i].offset + k] > 1u) {
                return 0;
            }
        }
    }
    return 1;
}

static int are_channels_possible(const fcsl_machine_t *machine, const uint8_t *image, const fcsl_gate_t *gate)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        if (!are_bools(&machine->fields[machine->channels[i].field], 1, image)) {
            return 0;
        }
    }
    return (unsigned)gate->state <= FCSL_GATE_SILENT;
}

static int is_companion_possible(const fcsl_companion_t *companion, const fcsl_sim_t *sim)
{
    const uint64_t hz = companion->machine->tick_hz;
    const uint64_t tick = companion->tick;
    if (tick != fcsl_run_tick(companion->run) || tick / hz >= (uint64_t)INT64_MAX / FCSL_NS_PER_S ||
        !are_channels_possible(companion->machine, companion->image, &companion->gate) ||
        !fcsl_hw_sim_is_valid(fcsl_run_simulated_hardware(companion->run))) {
        return 0;
    }
    if (sim->tick == 0 || tick == 0) {
        return sim->tick == 0 && tick == 0;
    }
    return companion->next_tick_ns > sim->plant.time_ns && fcsl_grid_time_ns(tick - 1u, hz) <= sim->plant.time_ns;
}

/* Where an instance is a machine, its struct holds what a machine may hold. */
static int is_machine_possible(const fcsl_instance_state_t *instance)
{
    return !instance->machine || fcsl_machine_model_takes(instance->machine, instance->data);
}

/* Whether the restored plant is at one instant of this simulation. Its vectors and numbers may be any. */
static int is_possible(const fcsl_sim_t *sim, uint64_t machine_tick)
{
    int possible = sim->tick == machine_tick && are_channels_possible(sim->machine, sim->image, &sim->gate);
    const int64_t now_ns = sim->tick > 0 ? fcsl_grid_time_ns(sim->tick - 1u, sim->machine->tick_hz) : 0;
    possible = possible && sim->plant.time_ns == now_ns;
    for (uint32_t i = 0; possible && i < sim->plant.instance_count; i++) {
        const fcsl_model_t *model = sim->plant.instances[i].model;
        possible = is_update_possible(sim, i, now_ns) &&
                   are_bools(model->fields, model->field_count, sim->plant.instances[i].data) &&
                   is_machine_possible(&sim->plant.instances[i]);
    }
    for (uint32_t i = 0; possible && i < sim->companion_count; i++) {
        possible = is_companion_possible(&sim->companions[i], sim);
    }
    for (uint32_t i = 0; possible && i < sim->group_count; i++) {
        possible = is_group_possible(&sim->groups[i], now_ns);
    }
    return possible;
}

int fcsl_sim_restore_checkpoint(fcsl_sim_t *sim, const void *bytes, size_t size, fcsl_error_t *error)
{
    const uint8_t *in = bytes;
    uint64_t tick = 0;
    if (sim->sensed || sim->recording || sim->external) {
        return fcsl_fail(error, "a simulation is restored between two ticks, before it records, with its own machine");
    }
    if (sim->link) {
        return fcsl_fail(error, "a serial link cannot be restored from a checkpoint");
    }
    if (check_head(sim, in, size, error) ||
        fcsl_run_checkpoint_tick(sim->run, in + HEAD_BYTES, (size_t)fcsl_get_u64(in + AT_MACHINE), 0, &tick, error)) {
        return -1;
    }
    if (tick > sim->plan.ticks) {
        return fcsl_fail(
            error, "of tick %" PRIu64 ", and this simulation ends at tick %" PRIu64 ": it needs a longer duration",
            tick, sim->plan.ticks);
    }
    const size_t machine = (size_t)fcsl_get_u64(in + AT_MACHINE);
    fcsl_plant_state_save(sim, sim->before);
    const int taken = fcsl_plant_state_restore(sim, in + HEAD_BYTES + machine, (size_t)fcsl_get_u64(in + AT_PLANT),
                                               fcsl_get_u32(in + AT_VERSION) == VERSION) == 0;
    const int possible = taken && is_possible(sim, tick);
    if (!possible || fcsl_run_restore_checkpoint(sim->run, in + HEAD_BYTES, machine, 0, error)) {
        (void)fcsl_plant_state_restore(sim, sim->before, fcsl_plant_state_bytes(sim), 0);
        return possible ? -1 : fcsl_fail(error, "damaged: its plant is at no instant of this simulation");
    }
    sim->failed = 0;
    const int is_until = sim->until != NULL && sim->until_held >= sim->plan.until_ticks;
    sim->status = is_until ? FCSL_SIM_UNTIL : sim->tick < sim->plan.ticks ? FCSL_SIM_RUNNING : FCSL_SIM_DURATION;
    fcsl_sim_publish(sim);
    return 0;
}
