/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated hardware: pins, ADC channels and registers of one run.
 */
#include "fcsl/fcsl_hw_sim.h"

#include <string.h>

/* ---- registers ----------------------------------------------------------------------------------------------------- */

/* Where the register is in the table, or would be. */
static uint32_t place_of(const fcsl_hw_sim_t *sim, uint32_t address)
{
    uint32_t low = 0;
    uint32_t high = sim->register_count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        if (sim->registers[middle].address < address) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

static int holds(const fcsl_hw_sim_t *sim, uint32_t place, uint32_t address)
{
    return place < sim->register_count && sim->registers[place].address == address;
}

uint32_t fcsl_hw_sim_register(const fcsl_hw_sim_t *sim, uint32_t address)
{
    const uint32_t place = place_of(sim, address);
    return holds(sim, place, address) ? sim->registers[place].value : 0u;
}

/* One entry less at `place`. */
static void close_up(fcsl_hw_sim_t *sim, uint32_t place)
{
    fcsl_hw_sim_register_t *at = &sim->registers[place];
    sim->register_count--;
    memmove(at, at + 1, (sim->register_count - place) * sizeof *at);
    sim->registers[sim->register_count] = (fcsl_hw_sim_register_t){0, 0};
}

int32_t fcsl_hw_sim_set_register(fcsl_hw_sim_t *sim, uint32_t address, uint32_t value)
{
    const uint32_t place = place_of(sim, address);
    fcsl_hw_sim_register_t *at = &sim->registers[place];
    const int held = holds(sim, place, address);
    if (value == 0) {
        if (held) {
            close_up(sim, place);
        }
        return 0;
    }
    if (!held) {
        if (sim->register_count == FCSL_HW_SIM_COUNT) {
            return -1;
        }
        memmove(at + 1, at, (sim->register_count - place) * sizeof *at);
        sim->register_count++;
    }
    *at = (fcsl_hw_sim_register_t){.address = address, .value = value};
    return 0;
}

/* ---- bytes from a file --------------------------------------------------------------------------------------------- */

int fcsl_hw_sim_is_valid(const fcsl_hw_sim_t *sim)
{
    uint8_t levels[FCSL_HW_SIM_COUNT]; /* a bool may not hold what a file does */
    int valid = sim->register_count <= FCSL_HW_SIM_COUNT;
    memcpy(levels, sim->gpio, sizeof levels);
    for (uint32_t i = 0; i < FCSL_HW_SIM_COUNT; i++) {
        const fcsl_hw_sim_register_t *at = &sim->registers[i];
        const int is_used = i < sim->register_count;
        valid = valid && levels[i] <= 1u && (at->value != 0) == is_used && (is_used || at->address == 0);
        valid = valid && (!is_used || i == 0 || at[-1].address < at->address);
    }
    return valid;
}

/* ---- the table ----------------------------------------------------------------------------------------------------- */

static int32_t read_gpio(void *ctx, uint32_t pin, bool *level)
{
    const fcsl_hw_sim_t *sim = ctx;
    if (pin >= FCSL_HW_SIM_COUNT) {
        return -1;
    }
    *level = sim->gpio[pin];
    return 0;
}

static int32_t write_gpio(void *ctx, uint32_t pin, bool level)
{
    fcsl_hw_sim_t *sim = ctx;
    if (pin >= FCSL_HW_SIM_COUNT) {
        return -1;
    }
    sim->gpio[pin] = level;
    return 0;
}

static int32_t read_adc(void *ctx, uint32_t channel, uint32_t *counts)
{
    const fcsl_hw_sim_t *sim = ctx;
    if (channel >= FCSL_HW_SIM_COUNT) {
        return -1;
    }
    *counts = sim->adc[channel];
    return 0;
}

static int32_t read_u32(void *ctx, uint32_t address, uint32_t *value)
{
    *value = fcsl_hw_sim_register(ctx, address);
    return 0;
}

static int32_t write_u32(void *ctx, uint32_t address, uint32_t value)
{
    return fcsl_hw_sim_set_register(ctx, address, value);
}

struct fcsl_hw fcsl_hw_simulated(fcsl_hw_sim_t *sim)
{
    const struct fcsl_hw hw = {
        .ctx = sim,
        .read_gpio = read_gpio,
        .write_gpio = write_gpio,
        .read_adc = read_adc,
        .read_u32 = read_u32,
        .write_u32 = write_u32,
    };
    return hw;
}
