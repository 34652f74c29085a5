/* SPDX-License-Identifier: Apache-2.0
 *
 * What the recorder writes: checkpoint, host writes, and the messages of one tick.
 */
#include "fcsl/fcsl_scalar.h"
#include "recorder_internal.h"
#include "telemetry.h"

/* Opens a message with the header and tick that all of them begin with; returns its stamp. */
static uint64_t begin(fcsl_recorder_t *recorder, fcsl_cdr_t *cdr, uint64_t tick)
{
    fcsl_telemetry_begin(cdr, recorder->run, tick, recorder->scratch, recorder->scratch_size);
    return fcsl_run_tick_time_ns(recorder->run, tick);
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

void fcsl_recorder_write(fcsl_recorder_t *recorder, uint64_t tick, const fcsl_write_t *write)
{
    fcsl_cdr_t cdr;
    const uint64_t time_ns = begin(recorder, &cdr, tick);
    fcsl_cdr_u8(&cdr, (uint8_t)write->kind);
    fcsl_cdr_string(&cdr, write->path);
    fcsl_cdr_u32(&cdr, write->element);
    fcsl_cdr_u32(&cdr, write->age_ticks);
    fcsl_cdr_u64(&cdr, (uint64_t)write->stamp_ns);
    uint8_t *bytes = fcsl_cdr_reserve_bytes(&cdr, write->size);
    if (bytes != NULL && write->size > 0) {
        memcpy(bytes, write->data, write->size);
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

/* Records one telemetry message of `tick`, if there is something to say. */
static void note(fcsl_recorder_t *recorder, uint32_t topic, fcsl_telemetry_t what, uint64_t tick)
{
    const int64_t size = fcsl_telemetry_write(recorder->run, what, tick, recorder->scratch, recorder->scratch_size);
    if (size != 0) {
        const uint64_t time_ns = fcsl_run_tick_time_ns(recorder->run, tick);
        fcsl_recorder_push(recorder, topic, time_ns, recorder->scratch, size < 0 ? 0 : (size_t)size);
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
    if (changed) {
        note(recorder, FCSL_TOPIC_HEALTH, FCSL_TELEMETRY_HEALTH, tick);
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
    if (changed) {
        note(recorder, FCSL_TOPIC_FAULTS, FCSL_TELEMETRY_FAULTS, tick);
    }
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
    note(recorder, FCSL_TOPIC_STATE, FCSL_TELEMETRY_STATE, tick);
    note(recorder, FCSL_TOPIC_TRANSITIONS, FCSL_TELEMETRY_TRANSITION, tick);
    note_health(recorder, tick);
    note_counters(recorder, tick);
    recorder->stepped = 1;
}
