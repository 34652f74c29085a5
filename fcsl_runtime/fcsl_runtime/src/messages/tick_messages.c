/* SPDX-License-Identifier: Apache-2.0
 *
 * State, health, faults and transitions of a tick as fcsl_msgs messages.
 */
#include "tick_messages.h"

#include "machine/fault_place.h"
#include "machine/machine_struct.h"

/* The machine and the struct that a tick left. */
typedef struct {
    const fcsl_machine_t *machine;
    const uint8_t *data;
} left_t;

/* The state at `offset` of the struct, or null when its number is none (a struct that something else damaged). */
static const fcsl_state_t *state_at(const left_t *left, uint32_t offset)
{
    const int32_t state = fcsl_read_i32(left->data, offset);
    return state >= 0 && (uint32_t)state < left->machine->state_count ? &left->machine->states[state] : NULL;
}

/* The first instance, in execution order, that ran in `tick` of `state` and made `request`; null when none did. */
static const fcsl_instance_t *requester(const left_t *left, const fcsl_state_t *state, uint64_t tick, int32_t request)
{
    for (uint32_t i = 0; i < state->schedule_count; i++) {
        const fcsl_schedule_t *entry = &state->schedule[i];
        const fcsl_instance_t *instance = &left->machine->instances[entry->instance];
        /* An instance that did not run keeps the pulse of its last run, which no longer counts. */
        if (tick % entry->divisor == entry->phase &&
            fcsl_read_i32(left->data, instance->request_offset) == request + 1) {
            return instance;
        }
    }
    return NULL;
}

static int guard_holds(const left_t *left, const fcsl_transition_t *edge)
{
    if (edge->guard_instance == FCSL_NONE) {
        return 1;
    }
    const int32_t health = fcsl_read_i32(left->data, left->machine->instances[edge->guard_instance].health_offset);
    return health >= 0 && health <= (int32_t)FCSL_STALE && (edge->guard_mask >> health & 1u) != 0;
}

/* The tick is over, so that its own is among the ticks in the state. */
static int time_has_come(const left_t *left, uint32_t transition)
{
    const fcsl_machine_t *machine = left->machine;
    return machine->after_ticks == NULL ||
           fcsl_read_u64(left->data, machine->ticks_in_state_offset) >= machine->after_ticks[transition];
}

/* Says which edge was latched at the end of `tick`: the same search as the machine's own, in the same order. */
static void put_transition(const left_t *left, uint64_t tick, const fcsl_state_t *from, const fcsl_state_t *to,
                           fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = left->machine;
    const char *request = "";
    const char *name = "";
    for (uint32_t i = 0; i < machine->transition_count; i++) {
        const fcsl_transition_t *edge = &machine->transitions[i];
        if (&machine->states[edge->from] != from || &machine->states[edge->to] != to || !guard_holds(left, edge) ||
            !time_has_come(left, i)) {
            continue;
        }
        if (edge->request == FCSL_NONE) {
            break;
        }
        const fcsl_instance_t *instance = requester(left, from, tick, edge->request);
        if (instance != NULL) {
            request = machine->requests[edge->request];
            name = instance->name;
            break;
        }
    }
    fcsl_cdr_string(cdr, from->name);
    fcsl_cdr_string(cdr, to->name);
    fcsl_cdr_string(cdr, request);
    fcsl_cdr_string(cdr, name);
}

static void put_instance_names(const fcsl_machine_t *machine, fcsl_cdr_t *cdr)
{
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_string(cdr, machine->instances[i].name);
    }
}

static void put_health(const left_t *left, fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = left->machine;
    put_instance_names(machine, cdr);
    uint8_t *health = fcsl_cdr_reserve_bytes(cdr, machine->instance_count);
    for (uint32_t i = 0; health != NULL && i < machine->instance_count; i++) {
        health[i] = (uint8_t)fcsl_read_i32(left->data, machine->instances[i].health_offset);
    }
}

static void put_counters(const left_t *left, fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = left->machine;
    put_instance_names(machine, cdr);
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_u64(cdr, fcsl_read_u64(left->data, machine->instances[i].faults_offset));
    }
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_u64(cdr, fcsl_read_u64(left->data, machine->instances[i].overruns_offset));
    }
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        char text[FCSL_FAULT_TEXT_MAX];
        fcsl_cdr_string(cdr, fcsl_fault_text(machine, left->data, i, text));
    }
}

int64_t fcsl_tick_message_write(const fcsl_machine_t *machine, const uint8_t *data, fcsl_tick_message_t what,
                                fcsl_stamp_t stamp, uint8_t *bytes, size_t capacity)
{
    const left_t left = {.machine = machine, .data = data};
    const fcsl_state_t *state = state_at(&left, machine->state_offset);
    const fcsl_state_t *next = state_at(&left, machine->next_state_offset);
    if (state == NULL || next == NULL) {
        return -1;
    }
    if (what == FCSL_TICK_TRANSITION && state == next) {
        return 0;
    }
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, bytes, capacity);
    switch (what) {
    case FCSL_TICK_STATE:
        fcsl_cdr_string(&cdr, state->name);
        fcsl_cdr_string(&cdr, next->name);
        break;
    case FCSL_TICK_TRANSITION:
        put_transition(&left, stamp.tick, state, next, &cdr);
        break;
    case FCSL_TICK_HEALTH:
        put_health(&left, &cdr);
        break;
    case FCSL_TICK_FAULTS:
        put_counters(&left, &cdr);
        break;
    default:
        return -1;
    }
    const size_t size = fcsl_cdr_end(&cdr);
    return size == 0 ? -1 : (int64_t)size;
}
