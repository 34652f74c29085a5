/* SPDX-License-Identifier: Apache-2.0
 *
 * Names what machine.lost_requests counts. Transitions that differ only in their guards and times have one name.
 */
#include "lost_requests.h"

#include <stdio.h>
#include <string.h>

#include "run_internal.h"

/* Null where the machine has no such counts. */
static const fcsl_field_t *counts_of(const fcsl_machine_t *machine)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const fcsl_field_t *field = &machine->fields[i];
        if (strcmp(field->path, "machine.lost_requests") == 0) {
            return field->type == FCSL_U64 && field->count == machine->transition_count ? field : NULL;
        }
    }
    return NULL;
}

static uint64_t count_of(const fcsl_field_t *counts, const uint8_t *data, uint32_t transition)
{
    return fcsl_read_u64(data, counts->offset + transition * (uint32_t)sizeof(uint64_t));
}

static int have_one_name(const fcsl_transition_t *a, const fcsl_transition_t *b)
{
    return a->from == b->from && a->to == b->to && a->request == b->request;
}

/* The count of all transitions with the name of this one; 0 where an earlier one has counted it. */
static uint64_t sum_of(const fcsl_machine_t *machine, const fcsl_field_t *counts, const uint8_t *data,
                       uint32_t transition)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < machine->transition_count; i++) {
        const uint64_t count = count_of(counts, data, i);
        if (count == 0 || !have_one_name(&machine->transitions[i], &machine->transitions[transition])) {
            continue;
        }
        if (i < transition) {
            return 0;
        }
        sum += count;
    }
    return sum;
}

int fcsl_lost_request_next(const fcsl_machine_t *machine, const uint8_t *data, uint32_t *next,
                           fcsl_lost_request_t *found)
{
    const fcsl_field_t *counts = counts_of(machine);
    for (uint32_t i = *next; counts != NULL && i < machine->transition_count; i++) {
        found->count = count_of(counts, data, i) != 0 ? sum_of(machine, counts, data, i) : 0;
        if (found->count == 0) {
            continue;
        }
        const fcsl_transition_t *edge = &machine->transitions[i];
        (void)snprintf(found->name, sizeof found->name, "%s -> %s: %s", machine->states[edge->from].name,
                       machine->states[edge->to].name,
                       edge->request == FCSL_NONE ? "" : machine->requests[edge->request]);
        *next = i + 1u;
        return 1;
    }
    return 0;
}
