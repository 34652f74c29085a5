/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands to pulses.
 */
#include "output_map.h"

#include <math.h>

/* Beyond any command or pulse; differences and quotients of such numbers are finite. */
static const double NUMBER_MAX = 1e9;
static const double NS_PER_S = 1e9;

static int is_between(double value, double one, double other)
{
    return value >= fmin(one, other) && value <= fmax(one, other);
}

const char *output_map_flaw(const board_pulse_t *rule)
{
    const double numbers[] = {rule->low,     rule->high, rule->minimum, rule->middle,
                              rule->maximum, rule->slew, rule->safe};
    for (uint32_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        if (!is_between(numbers[i], -NUMBER_MAX, NUMBER_MAX)) {
            return "a number is not finite, or beyond 1e9";
        }
    }
    if (rule->low >= rule->high) {
        return "low must be below high";
    }
    if (!is_between(rule->middle, rule->minimum, rule->maximum)) {
        return "middle must lie between minimum and maximum";
    }
    return rule->slew >= 0.0 ? NULL : "slew must not be negative";
}

output_map_t output_map(const board_pulse_t *rule, uint64_t now_ns)
{
    return (output_map_t){.pulse = rule->safe, .time_ns = now_ns};
}

/* On the line from (x0, y0) to (x1, y1), where x lies between. Rounding leaves no result beyond the ends. */
static double on_line(double x, double x0, double y0, double x1, double y1)
{
    const double y = y0 + (y1 - y0) * ((x - x0) / (x1 - x0));
    return fmax(fmin(y0, y1), fmin(fmax(y0, y1), y));
}

double output_map_pulse(const board_pulse_t *rule, double command)
{
    const double middle = (rule->low + rule->high) / 2.0;
    if (isnan(command)) {
        return rule->safe;
    }
    if (command <= rule->low) {
        return rule->minimum;
    }
    if (command >= rule->high) {
        return rule->maximum;
    }
    if (command < middle) {
        return on_line(command, rule->low, rule->minimum, middle, rule->middle);
    }
    return on_line(command, middle, rule->middle, rule->high, rule->maximum);
}

double output_map_next(output_map_t *map, const board_pulse_t *rule, double command, int armed, uint64_t now_ns)
{
    const uint64_t elapsed_ns = now_ns > map->time_ns ? now_ns - map->time_ns : 0u;
    const double reach = rule->slew * (double)elapsed_ns / NS_PER_S;
    const double wanted = armed ? output_map_pulse(rule, command) : rule->safe;
    if (!armed || rule->slew == 0.0 || fabs(wanted - map->pulse) <= reach) {
        map->pulse = wanted;
    } else {
        map->pulse += wanted > map->pulse ? reach : -reach;
    }
    map->time_ns += elapsed_ns;
    return map->pulse;
}
