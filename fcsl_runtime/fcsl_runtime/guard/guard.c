/* SPDX-License-Identifier: Apache-2.0
 *
 * What the guard does in a period.
 */
#define _GNU_SOURCE
#include "guard.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"

static const uint64_t SAFE_NS = 2000000000u; /* for how long safe values are waited for */

int guard_check_machine(const fcsl_machine_t *machine, fcsl_error_t *error)
{
    if (machine->arm_field == FCSL_NONE) {
        return fcsl_fail(error,
                         "machine '%.100s' does not say when its actuators are armed: name a bool output as \"arm\" in "
                         "its JSON",
                         machine->name);
    }
    if (machine->command_timeout_ns == 0u) {
        return fcsl_fail(error,
                         "machine '%.100s' does not say for how long its actuators keep a command: give "
                         "\"command_timeout_s\" in its JSON",
                         machine->name);
    }
    return 0;
}

int guard_open(guard_t *guard, const fcsl_machine_t *machine, fcsl_error_t *error)
{
    const size_t align = machine->align < 64u ? 64u : machine->align;
    const size_t size = ((size_t)machine->size + align - 1u) / align * align;
    guard->machine = machine;
    guard->table = fcsl_channel_table(machine);
    guard->data = aligned_alloc(align, size);
    guard->bytes = malloc(fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE));
    if (guard->data == NULL || guard->bytes == NULL) {
        return fcsl_fail(error, "out of memory for machine '%.100s'", machine->name);
    }
    memset(guard->data, 0, size);
    guard->gate = fcsl_gate(machine, guard->data);
    return 0;
}

void guard_free(guard_t *guard)
{
    free(guard->data);
    free(guard->bytes);
    guard->data = NULL;
    guard->bytes = NULL;
}

static void refuse(guard_t *guard, const char *why)
{
    guard->refused++;
    guard->refusal = why;
}

/* The slot is written by another process: nothing in it is believed. A command counts from when its tick began, so one
 * that waited in the flight program, or for a guard that was late, is old. */
static void take_command(guard_t *guard)
{
    size_t size = 0;
    uint64_t begun_ns = 0;
    fcsl_message_t message;
    if (!fcsl_guard_take(&guard->server, guard->bytes, &size, &begun_ns)) {
        return;
    }
    const fcsl_message_status_t status =
        fcsl_message_check(&guard->table, FCSL_ACTUATOR_MESSAGE, guard->bytes, size, &message);
    if (status != FCSL_MESSAGE_OK) {
        refuse(guard, fcsl_message_status_text(status));
    } else if (begun_ns > fcsl_monotonic_ns()) {
        refuse(guard, "its time is in the future");
    } else {
        guard->commands++;
        guard->tick = message.tick;
        fcsl_gate_command(&guard->gate, &message, begun_ns, guard->data);
    }
}

/* A command ends with the program that gave it, and the next program begins with a closed gate. */
static void poll_programs(guard_t *guard)
{
    const fcsl_guard_event_t event = fcsl_guard_poll(&guard->server);
    guard->turned_away += event == FCSL_GUARD_REFUSED;
    if (event == FCSL_GUARD_LEFT) {
        guard->gate = fcsl_gate(guard->machine, guard->data);
    }
}

void guard_period(guard_t *guard)
{
    const fcsl_gate_state_t before = guard->gate.state;
    poll_programs(guard);
    take_command(guard);
    const uint64_t now_ns = fcsl_monotonic_ns();
    fcsl_gate_wait(&guard->gate, now_ns, guard->data);
    guard->changes += guard->gate.state != before;
    guard->silences += guard->gate.state != before && guard->gate.state == FCSL_GATE_SILENT;
    outputs_put(&guard->outputs, guard->data, guard->gate.state == FCSL_GATE_ARMED, now_ns);
    guard->periods++;
}

uint32_t guard_make_safe(guard_t *guard, uint64_t period_ns)
{
    guard->gate = fcsl_gate(guard->machine, guard->data);
    return outputs_make_safe(&guard->outputs, guard->data, period_ns, SAFE_NS);
}
