/* SPDX-License-Identifier: Apache-2.0
 *
 * One period of the guard: takes a command from the slot, passes it through the gate, hands it to the actuators.
 */
#ifndef GUARD_GUARD_H
#define GUARD_GUARD_H

#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_guard.h"
#include "outputs.h"

typedef struct {
    const fcsl_machine_t *machine;
    fcsl_channel_table_t table;
    outputs_t outputs;
    fcsl_guard_server_t server;
    fcsl_gate_t gate;
    uint8_t *data;  /* a struct of the machine: what the actuators get */
    uint8_t *bytes; /* of a command */

    uint64_t tick; /* of the last command */
    uint64_t periods;
    uint64_t periods_missed; /* the guard woke when the next one was due, or later */
    uint64_t commands;
    uint64_t refused; /* commands that did not check out */
    const char *refusal; /* why the last one did not */
    uint64_t changes; /* of the gate's state */
    uint64_t silences;
    uint64_t turned_away; /* flight programs that came while another one had the slot */
} guard_t;

/* Refuses a machine that does not say when its actuators may move. 0, or -1. */
int guard_check_machine(const fcsl_machine_t *machine, fcsl_error_t *error);
/* Allocates; the gate is closed. 0, or -1. */
int guard_open(guard_t *guard, const fcsl_machine_t *machine, fcsl_error_t *error);
void guard_free(guard_t *guard);

void guard_period(guard_t *guard);
/* Closes the gate and waits until all devices have taken their safe values, which they get every period until then, for 2 s at most.
 * Returns how many have not taken them. */
uint32_t guard_make_safe(guard_t *guard, uint64_t period_ns);

#endif /* GUARD_GUARD_H */
