/* SPDX-License-Identifier: Apache-2.0
 *
 * The place of an instance's last fault as text.
 */
#include "fault_place.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "machine_struct.h"

/* ":<line>:<column>: " and the end of the text. */
enum { NUMBERS_BYTES = 32 };

size_t fcsl_fault_text_bytes(const fcsl_machine_t *machine)
{
    size_t most = 1;
    for (uint32_t i = 0; i < machine->fault_place_count; i++) {
        const fcsl_fault_place_t *place = &machine->fault_places[i];
        const size_t bytes = strlen(place->file) + strlen(place->cause) + NUMBERS_BYTES;
        most = bytes > most ? bytes : most;
    }
    return most;
}

const char *fcsl_fault_text(const fcsl_machine_t *machine, const uint8_t *data, uint32_t instance,
                            char text[FCSL_FAULT_TEXT_MAX])
{
    const uint32_t number = fcsl_read_u32(data, machine->instances[instance].fault_place_offset);
    text[0] = '\0';
    if (number == 0 || number > machine->fault_place_count) { /* a checkpoint of other sources may hold any number */
        return text;
    }
    const fcsl_fault_place_t *place = &machine->fault_places[number - 1u];
    if (place->file[0] == '\0') {
        (void)snprintf(text, FCSL_FAULT_TEXT_MAX, "%s", place->cause);
    } else {
        (void)snprintf(text, FCSL_FAULT_TEXT_MAX, "%s:%" PRIu32 ":%" PRIu32 ": %s", place->file, place->line,
                       place->column, place->cause);
    }
    return text;
}
