/* SPDX-License-Identifier: Apache-2.0
 *
 * Checks the values of a machine struct that comes from outside.
 */
#include "fcsl/fcsl_scalar.h"
#include "machine_struct.h"

const char *fcsl_struct_check(const fcsl_machine_t *machine, const uint8_t *bytes)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        const int checked = field->type == FCSL_BOOL || field->type >= FCSL_TRANSITION_REQUEST;
        const uint32_t scalar = fcsl_scalar_size(field->type);
        for (uint32_t j = 0; checked && j < field->count; j++) {
            uint8_t value[8] = {0};
            fcsl_scalars_export(value, bytes + field->offset + (size_t)j * scalar, field->type, 1);
            if (!fcsl_scalars_valid(machine, value, field->type, 1)) {
                return field->path;
            }
        }
    }
    const int32_t state = fcsl_read_i32(bytes, machine->state_offset);
    const int32_t next = fcsl_read_i32(bytes, machine->next_state_offset);
    const int states =
        state >= 0 && (uint32_t)state < machine->state_count && next >= 0 && (uint32_t)next < machine->state_count;
    return states ? NULL : "machine.state";
}
