/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of states, healths and requests, and back.
 */
#include "enumerators.h"

#include <stdio.h>
#include <string.h>

#include "health_name.h"

enum { ENUMERATOR_BYTES = 256 };

const char *fcsl_enumerator_name(const fcsl_machine_t *machine, uint8_t type, int32_t value, char *text, size_t size)
{
    if (type == FCSL_HEALTH) {
        return value >= 0 && value <= (int32_t)FCSL_STALE ? fcsl_health_name(value) : "?";
    }
    if (type == FCSL_STATE) {
        return value >= 0 && (uint32_t)value < machine->state_count ? machine->states[value].name : "?";
    }
    text[0] = '\0';
    if (value > 0 && (uint32_t)value <= machine->request_count) {
        (void)snprintf(text, size, "tr_%s", machine->requests[value - 1]);
    }
    return text;
}

static uint32_t count(const fcsl_machine_t *machine, uint8_t type)
{
    return type == FCSL_HEALTH  ? FCSL_STALE + 1u
           : type == FCSL_STATE ? machine->state_count
                                : machine->request_count + 1u;
}

int32_t fcsl_enumerator_find(const fcsl_machine_t *machine, uint8_t type, const char *name, size_t length)
{
    char text[ENUMERATOR_BYTES];
    for (uint32_t i = 0; i < count(machine, type); i++) {
        const char *own = fcsl_enumerator_name(machine, type, (int32_t)i, text, sizeof text);
        if (strlen(own) == length && strncmp(own, name, length) == 0) {
            return (int32_t)i;
        }
    }
    return FCSL_NONE;
}
