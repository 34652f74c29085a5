/* SPDX-License-Identifier: Apache-2.0
 *
 * The gate before the actuators.
 */
#include "fcsl/fcsl_gate.h"

#include <string.h>

int fcsl_is_armed(const fcsl_machine_t *machine, const void *data)
{
    return machine->arm_field == FCSL_NONE || ((const uint8_t *)data)[machine->fields[machine->arm_field].offset] == 1u;
}

static void make_safe(const fcsl_machine_t *machine, uint8_t *data)
{
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const fcsl_channel_t *channel = &machine->channels[i];
        const fcsl_field_t *field = &machine->fields[channel->field];
        if (channel->direction == FCSL_ACTUATOR && channel->safe != NULL) {
            memcpy(data + field->offset, channel->safe, field->size);
        }
    }
}

fcsl_gate_t fcsl_gate(const fcsl_machine_t *machine, void *data)
{
    make_safe(machine, data);
    return (fcsl_gate_t){.machine = machine};
}

void fcsl_gate_command(fcsl_gate_t *gate, const fcsl_message_t *message, uint64_t now_ns, void *data)
{
    gate->command_ns = now_ns;
    gate->state = message->armed != 0u ? FCSL_GATE_ARMED : FCSL_GATE_DISARMED;
    if (gate->state == FCSL_GATE_ARMED) {
        fcsl_message_apply(gate->machine, data, message);
    } else {
        make_safe(gate->machine, data);
    }
}

void fcsl_gate_wait(fcsl_gate_t *gate, uint64_t now_ns, void *data)
{
    const uint64_t limit_ns = gate->machine->command_timeout_ns;
    /* A clock that went back is no silence. */
    if (limit_ns != 0u && gate->state == FCSL_GATE_ARMED && now_ns > gate->command_ns &&
        now_ns - gate->command_ns >= limit_ns) {
        gate->state = FCSL_GATE_SILENT;
        make_safe(gate->machine, data);
    }
}

const char *fcsl_gate_state_text(fcsl_gate_state_t state)
{
    switch (state) {
    case FCSL_GATE_ARMED:
        return "armed";
    case FCSL_GATE_SILENT:
        return "silent";
    default:
        return "disarmed";
    }
}
