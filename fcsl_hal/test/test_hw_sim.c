/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated registers against a plain list of what was written last; and the same content always in the same bytes.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_hw_sim.h"
#include "fcsl_check.h"

enum { ADDRESSES = 1500, ROUNDS = 20000 };

static fcsl_hw_sim_t sim;
static fcsl_hw_sim_t other;
static uint32_t expected[ADDRESSES];

/* Far apart, in no order, the first and the last address among them. */
static uint32_t address_of(uint32_t i)
{
    return i == 0u ? UINT32_MAX : (i - 1u) * 2654435761u;
}

static uint32_t held(void)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < ADDRESSES; i++) {
        count += expected[i] != 0u;
    }
    return count;
}

static void test_against_a_list(struct fcsl_hw hw)
{
    uint32_t refused = 0;
    srand(1);
    for (uint32_t round = 0; round < ROUNDS; round++) {
        const uint32_t i = (uint32_t)rand() % ADDRESSES;
        const uint32_t value = rand() % 4 == 0 ? 0u : (uint32_t)rand();
        const int full = held() == FCSL_HW_SIM_COUNT && expected[i] == 0u && value != 0u;
        CHECK(hw.write_u32(hw.ctx, address_of(i), value) == (full ? -1 : 0));
        expected[i] = full ? 0u : value;
        refused += full ? 1u : 0u;
        uint32_t found = 1;
        CHECK(hw.read_u32(hw.ctx, address_of(i), &found) == 0 && found == expected[i]);
        CHECK(sim.register_count == held());
    }
    CHECK(refused > 100);
    for (uint32_t i = 0; i < ADDRESSES; i++) {
        CHECK(fcsl_hw_sim_register(&sim, address_of(i)) == expected[i]);
    }
}

/* Written in another order, and emptied again. */
static void test_bytes(void)
{
    static const fcsl_hw_sim_t empty;
    for (uint32_t i = ADDRESSES; i-- > 0;) {
        CHECK(fcsl_hw_sim_set_register(&other, address_of(i), expected[i]) == 0);
    }
    CHECK(memcmp(&other, &sim, sizeof sim) == 0);
    for (uint32_t i = 0; i < ADDRESSES; i++) {
        CHECK(fcsl_hw_sim_set_register(&other, address_of(i), 0) == 0);
    }
    CHECK(memcmp(&other, &empty, sizeof empty) == 0);
}

static void check_invalid(void)
{
    CHECK(!fcsl_hw_sim_is_valid(&other));
    other = sim;
    CHECK(fcsl_hw_sim_is_valid(&other));
}

/* Bytes of a file. `sim` is full here. */
static void test_validity(void)
{
    const uint32_t last = FCSL_HW_SIM_COUNT - 1;
    CHECK(sim.register_count == FCSL_HW_SIM_COUNT && fcsl_hw_sim_is_valid(&other)); /* empty */
    other = sim;
    other.register_count++;
    check_invalid();
    other.register_count--; /* a register behind the last */
    check_invalid();
    other.registers[last].value = 0;
    check_invalid();
    other.registers[last].address = other.registers[last - 1].address;
    check_invalid();
    memset(&other.gpio[last], 2, 1);
    check_invalid();
    other.register_count = 0;
    memset(other.registers, 0, sizeof other.registers);
    other.registers[0].address = 1;
    check_invalid();
}

static void test_pins_and_channels(struct fcsl_hw hw)
{
    bool level = false;
    uint32_t counts = 0;
    sim.adc[FCSL_HW_SIM_COUNT - 1] = UINT32_MAX;
    CHECK(hw.write_gpio(hw.ctx, FCSL_HW_SIM_COUNT - 1, true) == 0 && sim.gpio[FCSL_HW_SIM_COUNT - 1]);
    CHECK(hw.read_gpio(hw.ctx, FCSL_HW_SIM_COUNT - 1, &level) == 0 && level);
    CHECK(hw.read_adc(hw.ctx, FCSL_HW_SIM_COUNT - 1, &counts) == 0 && counts == UINT32_MAX);
    for (uint32_t number = FCSL_HW_SIM_COUNT; number != 0u; number = number < UINT32_MAX ? UINT32_MAX : 0u) {
        CHECK(hw.write_gpio(hw.ctx, number, true) != 0 && hw.read_gpio(hw.ctx, number, &level) != 0);
        CHECK(hw.read_adc(hw.ctx, number, &counts) != 0);
    }
}

int main(void)
{
    const struct fcsl_hw hw = fcsl_hw_simulated(&sim);
    test_against_a_list(hw);
    test_bytes();
    test_validity();
    test_pins_and_channels(hw);
    return 0;
}
