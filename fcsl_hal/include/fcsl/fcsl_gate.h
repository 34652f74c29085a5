/* SPDX-License-Identifier: Apache-2.0
 *
 * The gate before the actuators, the same in every mode. Commands go through while the machine arms them (docs/hardware/arming.md). While
 * it does not, and when no command has come for the machine's time-out, the actuators get their safe values.
 */
#ifndef FCSL_GATE_H
#define FCSL_GATE_H

#include "fcsl/fcsl_codec.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether the machine arms its actuators: what the actuator message of its last tick says. `data` is its struct. Only
 * the byte 1 arms: damaged memory does not. A machine without an arm field is armed in simulation; real actuators refuse it. */
int fcsl_is_armed(const fcsl_machine_t *machine, const void *data);

typedef enum {
    FCSL_GATE_DISARMED = 0, /* safe: so says the last command, or none has come yet */
    FCSL_GATE_ARMED = 1,    /* the actuators have what the last command says */
    FCSL_GATE_SILENT = 2    /* safe: no command for too long; the next one ends this */
} fcsl_gate_state_t;

typedef struct {
    const fcsl_machine_t *machine;
    uint64_t command_ns; /* when the last command came */
    fcsl_gate_state_t state;
} fcsl_gate_t;

/* A closed gate. `data` is a struct of the machine, of which the gate writes the fields of actuator channels alone: they hold
 * what the actuators get. A channel without a safe value keeps what it has. Times are of one clock: simulated or monotonic. */
fcsl_gate_t fcsl_gate(const fcsl_machine_t *machine, void *data);
/* An actuator message came at `now_ns`. */
void fcsl_gate_command(fcsl_gate_t *gate, const fcsl_message_t *message, uint64_t now_ns, void *data);
/* It is `now_ns`, and nothing came. */
void fcsl_gate_wait(fcsl_gate_t *gate, uint64_t now_ns, void *data);

/* "disarmed", "armed", "silent". */
const char *fcsl_gate_state_text(fcsl_gate_state_t state);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_GATE_H */
