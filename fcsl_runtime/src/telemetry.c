/* SPDX-License-Identifier: Apache-2.0
 *
 * What the recorder says: the messages of one tick, of one host write, of a change of state.
 */
#include "cdr.h"
#include "fcsl/fcsl_scalar.h"
#include "recorder_internal.h"

/* Opens a message with the header and tick that all of them begin with; returns its stamp. */
static uint64_t begin(fcsl_recorder_t *recorder, fcsl_cdr_t *cdr, uint64_t tick)
{
    const uint64_t time_ns = fcsl_run_tick_time_ns(recorder->run, tick);
    fcsl_cdr_begin(cdr, recorder->scratch, recorder->scratch_size);
    fcsl_cdr_header(cdr, time_ns);
    fcsl_cdr_u64(cdr, tick);
    return time_ns;
}

static void push(fcsl_recorder_t *recorder, uint32_t topic, uint64_t time_ns, const fcsl_cdr_t *cdr)
{
    fcsl_recorder_push(recorder, topic, time_ns, recorder->scratch, fcsl_cdr_end(cdr));
}

void fcsl_recorder_checkpoint(fcsl_recorder_t *recorder)
{
    const fcsl_machine_t *machine = recorder->machine;
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, fcsl_run_tick(recorder->run));
    fcsl_cdr_string(&cdr, machine->name);
    fcsl_cdr_string(&cdr, machine->source_hash);
    fcsl_cdr_string(&cdr, machine->layout_hash);
    fcsl_cdr_string(&cdr, machine->build_hash);
    uint8_t *bytes = fcsl_cdr_reserve_bytes(&cdr, machine->size);
    if (bytes != NULL) {
        fcsl_copy_canonical(machine, bytes, recorder->run->data);
    }
    push(recorder, FCSL_TOPIC_CHECKPOINT, time_ns, &cdr);
}

void fcsl_recorder_write(fcsl_recorder_t *recorder, uint64_t tick, fcsl_write_kind_t kind, const char *path,
                         uint32_t element, const uint8_t *data, uint32_t size)
{
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    fcsl_cdr_u8(&cdr, (uint8_t)kind);
    fcsl_cdr_string(&cdr, path);
    fcsl_cdr_u32(&cdr, element);
    uint8_t *bytes = fcsl_cdr_reserve_bytes(&cdr, size);
    if (bytes != NULL && size > 0) {
        memcpy(bytes, data, size);
    }
    push(recorder, FCSL_TOPIC_WRITES, time_ns, &cdr);
}

void fcsl_recorder_transition(fcsl_recorder_t *recorder, uint64_t tick, const char *from, const char *to,
                              const char *request, const char *instance)
{
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    fcsl_cdr_string(&cdr, from);
    fcsl_cdr_string(&cdr, to);
    fcsl_cdr_string(&cdr, request);
    fcsl_cdr_string(&cdr, instance);
    push(recorder, FCSL_TOPIC_TRANSITIONS, time_ns, &cdr);
}

/* The first instance, in execution order, that ran in `tick` of `state` and made `request`; null when none did. */
static const fcsl_instance_t *requester(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_state_t *state,
                                        uint64_t tick, int32_t request)
{
    for (uint32_t i = 0; i < state->schedule_count; i++) {
        const fcsl_schedule_t *entry = &state->schedule[i];
        const fcsl_instance_t *instance = &machine->instances[entry->instance];
        /* An instance that did not run keeps the pulse of its last run, which no longer counts. */
        if (tick % entry->divisor == entry->phase && fcsl_read_i32(data, instance->request_offset) == request + 1) {
            return instance;
        }
    }
    return NULL;
}

static int guard_holds(const fcsl_machine_t *machine, const uint8_t *data, const fcsl_transition_t *edge)
{
    if (edge->guard_instance == FCSL_NONE) {
        return 1;
    }
    const int32_t health = fcsl_read_i32(data, machine->instances[edge->guard_instance].health_offset);
    return health >= 0 && health <= (int32_t)FCSL_STALE && (edge->guard_mask >> health & 1u) != 0;
}

/* Says which edge was latched at the end of `tick`: the same search as the machine's own, in the same order. */
static void note_transition(fcsl_recorder_t *recorder, uint64_t tick, int32_t from, int32_t to)
{
    const fcsl_machine_t *machine = recorder->machine;
    const uint8_t *data = recorder->run->data;
    const char *request = "";
    const char *name = "";
    for (uint32_t i = 0; i < machine->transition_count; i++) {
        const fcsl_transition_t *edge = &machine->transitions[i];
        if (edge->from != from || edge->to != to || !guard_holds(machine, data, edge)) {
            continue;
        }
        if (edge->request == FCSL_NONE) {
            break;
        }
        const fcsl_instance_t *instance = requester(machine, data, &machine->states[from], tick, edge->request);
        if (instance != NULL) {
            request = machine->requests[edge->request];
            name = instance->name;
            break;
        }
    }
    fcsl_recorder_transition(recorder, tick, machine->states[from].name, machine->states[to].name, request, name);
}

static void note_state(fcsl_recorder_t *recorder, uint64_t tick)
{
    const fcsl_machine_t *machine = recorder->machine;
    const int32_t state = fcsl_read_i32(recorder->run->data, machine->state_offset);
    const int32_t next = fcsl_read_i32(recorder->run->data, machine->next_state_offset);
    if (state < 0 || (uint32_t)state >= machine->state_count || next < 0 || (uint32_t)next >= machine->state_count) {
        recorder->dropped++;
        return;
    }
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    fcsl_cdr_string(&cdr, machine->states[state].name);
    fcsl_cdr_string(&cdr, machine->states[next].name);
    push(recorder, FCSL_TOPIC_STATE, time_ns, &cdr);
    if (state != next) {
        note_transition(recorder, tick, state, next);
    }
}

static void put_instance_names(const fcsl_machine_t *machine, fcsl_cdr_t *cdr)
{
    fcsl_cdr_u32(cdr, machine->instance_count);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_cdr_string(cdr, machine->instances[i].name);
    }
}

static void note_health(fcsl_recorder_t *recorder, uint64_t tick)
{
    const fcsl_machine_t *machine = recorder->machine;
    int changed = !recorder->stepped;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const uint8_t health = (uint8_t)fcsl_read_i32(recorder->run->data, machine->instances[i].health_offset);
        changed = changed || health != recorder->health[i];
        recorder->health[i] = health;
    }
    if (!changed) {
        return;
    }
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    put_instance_names(machine, &cdr);
    uint8_t *bytes = fcsl_cdr_reserve_bytes(&cdr, machine->instance_count);
    if (bytes != NULL && machine->instance_count > 0) {
        memcpy(bytes, recorder->health, machine->instance_count);
    }
    push(recorder, FCSL_TOPIC_HEALTH, time_ns, &cdr);
}

static void put_counters(const uint64_t *counters, uint32_t count, fcsl_cdr_t *cdr)
{
    fcsl_cdr_u32(cdr, count);
    for (uint32_t i = 0; i < count; i++) {
        fcsl_cdr_u64(cdr, counters[i]);
    }
}

static void note_counters(fcsl_recorder_t *recorder, uint64_t tick)
{
    const fcsl_machine_t *machine = recorder->machine;
    int changed = !recorder->stepped;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const uint64_t faults = fcsl_read_u64(recorder->run->data, machine->instances[i].faults_offset);
        const uint64_t overruns = fcsl_read_u64(recorder->run->data, machine->instances[i].overruns_offset);
        changed = changed || faults != recorder->faults[i] || overruns != recorder->overruns[i];
        recorder->faults[i] = faults;
        recorder->overruns[i] = overruns;
    }
    if (!changed) {
        return;
    }
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    put_instance_names(machine, &cdr);
    put_counters(recorder->faults, machine->instance_count, &cdr);
    put_counters(recorder->overruns, machine->instance_count, &cdr);
    push(recorder, FCSL_TOPIC_FAULTS, time_ns, &cdr);
}

void fcsl_recorder_tick(fcsl_recorder_t *recorder, uint64_t tick)
{
    const fcsl_machine_t *machine = recorder->machine;
    const uint64_t time_ns = fcsl_run_tick_time_ns(recorder->run, tick);
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_layout_t *layout = &recorder->run->layouts[i];
        fcsl_layout_write(layout, recorder->run->data, tick, time_ns, recorder->scratch);
        fcsl_recorder_push(recorder, FCSL_TOPIC_FIRST_INSTANCE + i, time_ns, recorder->scratch, layout->size);
    }
    note_state(recorder, tick);
    note_health(recorder, tick);
    note_counters(recorder, tick);
    recorder->stepped = 1;
}
