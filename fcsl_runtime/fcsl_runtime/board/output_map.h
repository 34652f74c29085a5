/* SPDX-License-Identifier: Apache-2.0
 *
 * From a command to the pulse of an output, by the rules of board_pulse_t.
 */
#ifndef BOARD_OUTPUT_MAP_H
#define BOARD_OUTPUT_MAP_H

#include "board_plan.h"

/* The last pulse of an output, and its time. */
typedef struct {
    double pulse;
    uint64_t time_ns;
} output_map_t;

/* What is wrong with the numbers of a pulse, or null. The other functions are for pulses without a flaw. */
const char *output_map_flaw(const board_pulse_t *rule);
/* An output that is safe. */
output_map_t output_map(const board_pulse_t *rule, uint64_t now_ns);
/* The pulse of a command, wherever the last one was. */
double output_map_pulse(const board_pulse_t *rule, double command);
/* The next pulse: on its way to that of the command; safe when the actuators are not armed. A clock that goes back moves nothing. */
double output_map_next(output_map_t *map, const board_pulse_t *rule, double command, int armed, uint64_t now_ns);

#endif /* BOARD_OUTPUT_MAP_H */
