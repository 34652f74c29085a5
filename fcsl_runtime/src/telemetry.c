/* SPDX-License-Identifier: Apache-2.0 */
#include "telemetry.h"

void fcsl_telemetry_begin(fcsl_cdr_t *cdr, const fcsl_run_t *run, uint64_t tick, uint8_t *bytes, size_t capacity)
{
    fcsl_cdr_begin(cdr, bytes, capacity);
    fcsl_cdr_header(cdr, fcsl_run_tick_time_ns(run, tick));
    fcsl_cdr_u64(cdr, tick);
}

/* The state at `offset` of the struct, or null when its number is none (a struct that something else damaged). */
static const fcsl_state_t *state_at(const fcsl_run_t *run, uint32_t offset)
{
    const int32_t state = fcsl_read_i32(run->data, offset);
    return state >= 0 && (uint32_t)state < run->machine->state_count ? &run->machine->states[state] : NULL;
}

/* The first instance, in execution order, that ran in `tick` of `state` and made `request`; null when none did. */
static const fcsl_instance_t *requester(const fcsl_run_t *run, const fcsl_state_t *state, uint64_t tick,
                                        int32_t request)
{
    for (uint32_t i = 0; i < state->schedule_count; i++) {
        const fcsl_schedule_t *entry = &state->schedule[i];
        const fcsl_instance_t *instance = &run->machine->instances[entry->instance];
        /* An instance that did not run keeps the pulse of its last run, which no longer counts. */
        if (tick % entry->divisor == entry->phase &&
            fcsl_read_i32(run->data, instance->request_offset) == request + 1) {
            return instance;
        }
    }
    return NULL;
}

static int guard_holds(const fcsl_run_t *run, const fcsl_transition_t *edge)
{
    if (edge->guard_instance == FCSL_NONE) {
        return 1;
    }
    const int32_t health = fcsl_read_i32(run->data, run->machine->instances[edge->guard_instance].health_offset);
    return health >= 0 && health <= (int32_t)FCSL_STALE && (edge->guard_mask >> health & 1u) != 0;
}

/* Says which edge was latched at the end of `tick`: the same search as the machine's own, in the same order. */
static void put_transition(const fcsl_run_t *run, uint64_t tick, const fcsl_state_t *from, const fcsl_state_t *to,
                           fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = run->machine;
    const char *request = "";
    const char *name = "";
    for (uint32_t i = 0; i < machine->transition_count; i++) {
        const fcsl_transition_t *edge = &machine->transitions[i];
        if (&machine->states[edge->from] != from || &machine->states[edge->to] != to || !guard_holds(run, edge)) {
            continue;
        }
        if (edge->request == FCSL_NONE) {
            break;
        }
        const fcsl_instance_t *instance = requester(run, from, tick, edge->request);
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

static void put_health(const fcsl_run_t *run, fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = run->machine;
    put_instance_names(machine, cdr);
    uint8_t *health = fcsl_cdr_reserve_bytes(cdr, machine->instance_count);
    for (uint32_t i = 0; health != NULL && i < machine->instance_count; i++) {
        health[i] = (uint8_t)fcsl_read_i32(run->data, machine->instances[i].health_offset);
    }
}

static void put_counters(const fcsl_run_t *run, fcsl_cdr_t *cdr)
{
    const fcsl_machine_t *machine = run->machine;
    put_instance_names(machine, cdr);
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_u64(cdr, fcsl_read_u64(run->data, machine->instances[i].faults_offset));
    }
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_u64(cdr, fcsl_read_u64(run->data, machine->instances[i].overruns_offset));
    }
}

int64_t fcsl_telemetry_write(const fcsl_run_t *run, fcsl_telemetry_t what, uint64_t tick, uint8_t *bytes,
                             size_t capacity)
{
    const fcsl_state_t *state = state_at(run, run->machine->state_offset);
    const fcsl_state_t *next = state_at(run, run->machine->next_state_offset);
    if (state == NULL || next == NULL) {
        return -1;
    }
    if (what == FCSL_TELEMETRY_TRANSITION && state == next) {
        return 0;
    }
    fcsl_cdr_t cdr;
    fcsl_telemetry_begin(&cdr, run, tick, bytes, capacity);
    switch (what) {
    case FCSL_TELEMETRY_STATE:
        fcsl_cdr_string(&cdr, state->name);
        fcsl_cdr_string(&cdr, next->name);
        break;
    case FCSL_TELEMETRY_TRANSITION:
        put_transition(run, tick, state, next, &cdr);
        break;
    case FCSL_TELEMETRY_HEALTH:
        put_health(run, &cdr);
        break;
    case FCSL_TELEMETRY_FAULTS:
        put_counters(run, &cdr);
        break;
    default:
        return -1;
    }
    const size_t size = fcsl_cdr_end(&cdr);
    return size == 0 ? -1 : (int64_t)size;
}

int64_t fcsl_run_telemetry(const fcsl_run_t *run, fcsl_telemetry_t what, uint8_t *cdr, size_t capacity)
{
    const uint64_t completed = fcsl_run_tick(run);
    return fcsl_telemetry_write(run, what, completed == 0 ? 0 : completed - 1u, cdr, capacity);
}
