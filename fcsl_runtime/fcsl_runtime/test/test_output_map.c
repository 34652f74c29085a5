/* SPDX-License-Identifier: Apache-2.0
 *
 * From commands to pulses: the points of the map, and what holds for any map, command and time. The source is compiled in: it is part of
 * programs.
 */
#include "../board/output_map.c"

#include "fcsl_check.h"

enum { RULES = 2000, COMMANDS = 200 };

static const board_pulse_t SERVO = {
    .low = -1.0, .high = 1.0, .minimum = 1000.0, .middle = 1600.0, .maximum = 2000.0, .slew = 500.0, .safe = 1500.0};

/* The same numbers in each run: xorshift64*. */
static uint64_t random_state = UINT64_C(88172645463325252);

static double uniform(double low, double high)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    const uint64_t bits = random_state * UINT64_C(2685821657736338717);
    return low + (high - low) * ((double)(bits >> 11) * 0x1p-53);
}

/* Any rule without a flaw, of any size, reversed ones too. */
static board_pulse_t random_rule(void)
{
    const double scale = pow(10.0, uniform(-6.0, 8.0));
    board_pulse_t rule = {
        .low = uniform(-scale, scale), .minimum = uniform(0.0, scale), .maximum = uniform(0.0, scale)};
    rule.high = rule.low + uniform(1e-9, 1.0) * scale;
    rule.middle = uniform(fmin(rule.minimum, rule.maximum), fmax(rule.minimum, rule.maximum));
    rule.slew = uniform(0.0, 1.0) < 0.2 ? 0.0 : uniform(0.0, 10.0) * scale;
    rule.safe = uniform(fmin(rule.minimum, rule.maximum), fmax(rule.minimum, rule.maximum));
    return rule;
}

static double random_command(const board_pulse_t *rule)
{
    static const double odd[] = {NAN, INFINITY, -INFINITY, 0.0, 1e308, -1e308, 5e-324};
    const double width = rule->high - rule->low;
    const double kind = uniform(0.0, 1.0);
    return kind < 0.1 ? odd[(size_t)uniform(0.0, 7.0)] : uniform(rule->low - width, rule->high + width);
}

static int is_within(const board_pulse_t *rule, double pulse)
{
    return pulse >= fmin(rule->minimum, rule->maximum) && pulse <= fmax(rule->minimum, rule->maximum);
}

static void test_points(void)
{
    CHECK(output_map_pulse(&SERVO, -1.0) == 1000.0 && output_map_pulse(&SERVO, -2.0) == 1000.0);
    CHECK(output_map_pulse(&SERVO, 0.0) == 1600.0 && output_map_pulse(&SERVO, 1.0) == 2000.0);
    CHECK(output_map_pulse(&SERVO, -0.5) == 1300.0 && output_map_pulse(&SERVO, 0.5) == 1800.0);
    CHECK(output_map_pulse(&SERVO, INFINITY) == 2000.0 && output_map_pulse(&SERVO, -INFINITY) == 1000.0);
    CHECK(output_map_pulse(&SERVO, NAN) == 1500.0 && output_map_pulse(&SERVO, -NAN) == 1500.0);
    board_pulse_t reversed = SERVO;
    reversed.minimum = 2000.0;
    reversed.maximum = 1000.0;
    CHECK(output_map_flaw(&reversed) == NULL);
    CHECK(output_map_pulse(&reversed, -1.0) == 2000.0 && output_map_pulse(&reversed, -0.5) == 1800.0);
    CHECK(output_map_pulse(&reversed, 0.5) == 1300.0 && output_map_pulse(&reversed, 7.0) == 1000.0);
}

static void test_flaws(void)
{
    const double wrong[] = {NAN, INFINITY, -INFINITY, 1.1e9, -1.1e9};
    CHECK(output_map_flaw(&SERVO) == NULL);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const board_pulse_t good = SERVO;
        board_pulse_t rules[] = {good, good, good, good, good, good, good};
        rules[0].low = rules[1].high = rules[2].minimum = rules[3].middle = wrong[i];
        rules[4].maximum = rules[5].slew = rules[6].safe = wrong[i];
        for (size_t r = 0; r < sizeof rules / sizeof rules[0]; r++) {
            CHECK(output_map_flaw(&rules[r]) != NULL);
        }
    }
    board_pulse_t rule = SERVO;
    rule.low = rule.high;
    CHECK(output_map_flaw(&rule) != NULL);
    rule = SERVO;
    rule.middle = 999.0;
    CHECK(output_map_flaw(&rule) != NULL);
    rule = SERVO;
    rule.slew = -1.0;
    CHECK(output_map_flaw(&rule) != NULL);
}

/* A greater command is no pulse back, and no pulse lies beyond the ends. */
static void test_monotone_and_within(void)
{
    for (int i = 0; i < RULES; i++) {
        const board_pulse_t rule = random_rule();
        CHECK(output_map_flaw(&rule) == NULL);
        const double sign = rule.maximum >= rule.minimum ? 1.0 : -1.0;
        for (int k = 0; k < COMMANDS; k++) {
            const double one = random_command(&rule);
            const double other = random_command(&rule);
            const double pulse = output_map_pulse(&rule, one);
            CHECK(is_within(&rule, pulse));
            if (one <= other) {
                CHECK(sign * pulse <= sign * output_map_pulse(&rule, other));
            }
        }
    }
}

/* Whatever is commanded and however long a period lasts: the slew is kept while the output is armed, and it is safe at once when it is
 * not. */
static void test_slew_and_safe(void)
{
    for (int i = 0; i < RULES; i++) {
        const board_pulse_t rule = random_rule();
        uint64_t now_ns = (uint64_t)uniform(0.0, 1e18);
        output_map_t map = output_map(&rule, now_ns);
        for (int k = 0; k < COMMANDS; k++) {
            const uint64_t period_ns = (uint64_t)pow(10.0, uniform(0.0, 10.0)) - 1u;
            const double before = map.pulse;
            const double reach = rule.slew * (double)period_ns / 1e9;
            const int armed = uniform(0.0, 1.0) < 0.9;
            const double command = random_command(&rule);
            now_ns += period_ns;
            const double pulse = output_map_next(&map, &rule, command, armed, now_ns);
            CHECK(pulse == map.pulse && is_within(&rule, pulse));
            if (!armed) {
                CHECK(pulse == rule.safe);
            } else if (rule.slew == 0.0) {
                CHECK(pulse == output_map_pulse(&rule, command));
            } else { /* a difference is rounded */
                CHECK(fabs(pulse - before) <= reach + 1e-15 * (fabs(pulse) + fabs(before)));
                CHECK(fabs(pulse - before) + 1e-15 * (fabs(pulse) + fabs(before)) >=
                      fmin(reach, fabs(output_map_pulse(&rule, command) - before)));
            }
        }
    }
}

static void test_slew_restarts_from_safe(void)
{
    output_map_t map = output_map(&SERVO, 1000u);
    CHECK(output_map_next(&map, &SERVO, 1.0, 1, 1000u) == 1500.0);
    CHECK(output_map_next(&map, &SERVO, 1.0, 1, 500001000u) == 1750.0);
    CHECK(output_map_next(&map, &SERVO, 1.0, 1, 1000u) == 1750.0); /* a clock that goes back, and forth */
    CHECK(output_map_next(&map, &SERVO, 1.0, 1, 500001000u) == 1750.0);
    CHECK(output_map_next(&map, &SERVO, 1.0, 1, 5000001000u) == 2000.0);
    CHECK(output_map_next(&map, &SERVO, NAN, 1, 5200001000u) == 1900.0); /* armed: on its way to safe */
    CHECK(output_map_next(&map, &SERVO, 1.0, 0, 5200001001u) == 1500.0);
    CHECK(output_map_next(&map, &SERVO, 1.0, 0, 9200001001u) == 1500.0);
    CHECK(output_map_next(&map, &SERVO, -1.0, 1, 9400001001u) == 1400.0);
}

/* A safe pulse may lie beyond the ends: a motor without pulses stands. */
static void test_safe_beyond_the_ends(void)
{
    board_pulse_t motor = SERVO;
    motor.safe = 0.0;
    CHECK(output_map_flaw(&motor) == NULL);
    output_map_t map = output_map(&motor, 0u);
    CHECK(output_map_next(&map, &motor, -1.0, 0, 1000000000u) == 0.0);
    CHECK(output_map_next(&map, &motor, -1.0, 1, 2000000000u) == 500.0);
    CHECK(output_map_next(&map, &motor, -1.0, 1, 4000000000u) == 1000.0);
}

int main(void)
{
    test_points();
    test_flaws();
    test_monotone_and_within();
    test_slew_and_safe();
    test_slew_restarts_from_safe();
    test_safe_beyond_the_ends();
    return 0;
}
