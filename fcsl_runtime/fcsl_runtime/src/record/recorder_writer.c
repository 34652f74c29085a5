/* SPDX-License-Identifier: Apache-2.0
 *
 * The recorder's thread: makes messages of what the ring brings and writes them into the bag.
 */
#define _GNU_SOURCE
#include <inttypes.h>
#include <time.h>

#include "recorder.h"
#include "recorder_internal.h"
#include "machine/machine_struct.h"
#include "messages/event_message.h"
#include "messages/tick_messages.h"
#include "fcsl/fcsl_tick_time.h"

/* Records that are written before the clock is looked at again. */
enum { BATCH_RECORDS = 256 };

static int put(fcsl_recorder_t *recorder, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, size_t size)
{
    return fcsl_bag_write(recorder->bag, topic, time_ns, cdr, (uint32_t)size, &recorder->failure);
}

/* Writes the message of `size` bytes that is in the scratch. */
static int put_scratch(fcsl_recorder_t *recorder, uint32_t topic, fcsl_stamp_t stamp, size_t size)
{
    if (size == 0) {
        return fcsl_fail(&recorder->failure, "a message of tick %" PRIu64 " is too large", stamp.tick);
    }
    return put(recorder, topic, stamp.time_ns, recorder->scratch, size);
}

static int put_checkpoint(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data)
{
    if (fcsl_recorder_split(recorder, stamp) != 0) {
        return -1;
    }
    return put_scratch(recorder, FCSL_TOPIC_CHECKPOINT, stamp,
                       fcsl_checkpoint_message(recorder->machine, data, recorder->verdicts.monitor,
                                               data + recorder->machine->size, stamp, recorder->scratch,
                                               recorder->scratch_size));
}

static int put_write(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data)
{
    fcsl_write_t write;
    memcpy(&write, data, sizeof write);
    write.data = data + sizeof write;
    return put_scratch(recorder, FCSL_TOPIC_WRITES, stamp,
                       fcsl_write_message(&write, stamp, recorder->scratch, recorder->scratch_size));
}

static int put_forced(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data)
{
    const fcsl_state_t *states[2];
    memcpy(states, data, sizeof states);
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, recorder->scratch, recorder->scratch_size);
    fcsl_cdr_string(&cdr, states[0]->name);
    fcsl_cdr_string(&cdr, states[1]->name);
    fcsl_cdr_string(&cdr, "");
    fcsl_cdr_string(&cdr, "");
    fcsl_recorder_trigger(recorder, stamp.time_ns);
    return put_scratch(recorder, FCSL_TOPIC_TRANSITIONS, stamp, fcsl_cdr_end(&cdr));
}

static int note_verdicts(fcsl_recorder_t *recorder, fcsl_stamp_t stamp)
{
    return put_scratch(recorder, recorder->own_topics - 1u, stamp,
                       fcsl_verdict_message(&recorder->verdicts, recorder->machine, recorder->verdicts_seen, stamp,
                                            recorder->scratch, recorder->scratch_size));
}

static uint64_t count_violations(const fcsl_verdict_table_t *table, const uint8_t *rows)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < table->monitor->requirement_count; i++) {
        fcsl_verdict_row_t row;
        memcpy(&row, rows + i * sizeof row, sizeof row);
        count += row.violations;
    }
    return count;
}

static int put_verdicts(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data)
{
    const fcsl_verdict_table_t *table = &recorder->verdicts;
    if (recorder->has_verdicts && count_violations(table, data) > count_violations(table, recorder->verdicts_seen)) {
        fcsl_recorder_trigger(recorder, stamp.time_ns);
    }
    memcpy(recorder->verdicts_seen, data, fcsl_verdict_rows_bytes(table));
    recorder->has_verdicts = 1;
    return note_verdicts(recorder, stamp);
}

static int put_events(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data, uint32_t size)
{
    int status = 0;
    for (uint32_t at = 0; at < size && status == 0; at += (uint32_t)sizeof(fcsl_told_event_t)) {
        fcsl_told_event_t event;
        memcpy(&event, data + at, sizeof event);
        status = put_scratch(
            recorder, FCSL_TOPIC_FIRST_SHOWN + recorder->shown_count, stamp,
            fcsl_event_message(recorder->machine, &event, stamp, recorder->scratch, recorder->scratch_size));
    }
    return status;
}

/* Records one fcsl_msgs message of a tick, if there is something to say. */
static int note(fcsl_recorder_t *recorder, uint32_t topic, fcsl_tick_message_t what, fcsl_stamp_t stamp)
{
    const int64_t size = fcsl_tick_message_write(recorder->machine, recorder->data, what, stamp, recorder->scratch,
                                                 recorder->scratch_size);
    if (size < 0) {
        return fcsl_fail(&recorder->failure, "the machine struct is damaged: tick %" PRIu64 " is of no state",
                         stamp.tick);
    }
    if (size > 0 && what == FCSL_TICK_TRANSITION) {
        fcsl_recorder_trigger(recorder, stamp.time_ns);
    }
    return size == 0 ? 0 : put(recorder, topic, stamp.time_ns, recorder->scratch, (size_t)size);
}

static int note_health(fcsl_recorder_t *recorder, fcsl_stamp_t stamp)
{
    const fcsl_machine_t *machine = recorder->machine;
    int changed = !recorder->status_written;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const uint8_t health = (uint8_t)fcsl_read_i32(recorder->data, machine->instances[i].health_offset);
        changed = changed || health != recorder->health[i];
        recorder->health[i] = health;
    }
    return changed ? note(recorder, FCSL_TOPIC_HEALTH, FCSL_TICK_HEALTH, stamp) : 0;
}

static int note_counters(fcsl_recorder_t *recorder, fcsl_stamp_t stamp)
{
    const fcsl_machine_t *machine = recorder->machine;
    int changed = !recorder->status_written;
    int has_faulted = 0;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const uint64_t faults = fcsl_read_u64(recorder->data, machine->instances[i].faults_offset);
        const uint64_t overruns = fcsl_read_u64(recorder->data, machine->instances[i].overruns_offset);
        const uint32_t place = fcsl_read_u32(recorder->data, machine->instances[i].fault_place_offset);
        changed = changed || faults != recorder->faults[i] || overruns != recorder->overruns[i] ||
                  place != recorder->fault_places[i];
        has_faulted = has_faulted || faults > recorder->faults[i];
        recorder->faults[i] = faults;
        recorder->overruns[i] = overruns;
        recorder->fault_places[i] = place;
    }
    if (has_faulted && recorder->status_seen) {
        fcsl_recorder_trigger(recorder, stamp.time_ns);
    }
    return changed ? note(recorder, FCSL_TOPIC_FAULTS, FCSL_TICK_FAULTS, stamp) : 0;
}

static int put_tick(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *data)
{
    for (uint32_t i = 0; i < recorder->range_count; i++) {
        const fcsl_range_t range = recorder->ranges[i];
        memcpy(recorder->data + range.offset, data, range.size);
        data += range.size;
    }
    for (uint32_t i = 0; i < recorder->shown_count; i++) {
        const fcsl_record_topic_t *shown = &recorder->shown[i];
        fcsl_layout_fill(&shown->layout, recorder->data, stamp.tick, stamp.time_ns, shown->message);
        if (put(recorder, FCSL_TOPIC_FIRST_SHOWN + i, stamp.time_ns, shown->message, shown->layout.size) != 0) {
            return -1;
        }
    }
    if (note(recorder, FCSL_TOPIC_STATE, FCSL_TICK_STATE, stamp) != 0 ||
        note(recorder, FCSL_TOPIC_TRANSITIONS, FCSL_TICK_TRANSITION, stamp) != 0 || note_health(recorder, stamp) != 0 ||
        note_counters(recorder, stamp) != 0) {
        return -1;
    }
    if (!recorder->status_written && recorder->status_seen && recorder->has_verdicts &&
        note_verdicts(recorder, stamp) != 0) {
        return -1;
    }
    recorder->status_written = 1;
    recorder->status_seen = 1;
    return 0;
}

static int put_record(fcsl_recorder_t *recorder, const fcsl_record_t *record, const uint8_t *data)
{
    const int by_tick = record->time_ns == FCSL_TICK_TIME;
    const fcsl_stamp_t stamp = {
        .tick = record->tick,
        .time_ns = by_tick ? fcsl_tick_time_ns(recorder->machine->tick_hz, record->tick) : record->time_ns,
    };
    switch (record->kind) {
    case FCSL_RECORD_TICK:
        return put_tick(recorder, stamp, data);
    case FCSL_RECORD_WRITE:
        return put_write(recorder, stamp, data);
    case FCSL_RECORD_FORCED:
        return put_forced(recorder, stamp, data);
    case FCSL_RECORD_CHECKPOINT:
        return put_checkpoint(recorder, stamp, data);
    case FCSL_RECORD_VERDICTS:
        return put_verdicts(recorder, stamp, data);
    case FCSL_RECORD_EVENTS:
        return put_events(recorder, stamp, data, record->size);
    default:
        return put(recorder, record->kind - FCSL_RECORD_MESSAGE, stamp.time_ns, data, record->size);
    }
}

static void note_failure(fcsl_recorder_t *recorder, int status)
{
    if (status != 0) {
        atomic_store(&recorder->failed, 1);
    }
}

/* Writes records that wait, `most` of them; after a failure they are counted instead, so that nobody waits for room in vain. */
static fcsl_ring_status_t write_batch(fcsl_recorder_t *recorder, int most, int *unflushed)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    fcsl_ring_status_t status = FCSL_RING_EMPTY;
    fcsl_bag_lock(recorder->bag);
    for (int i = 0; i < most; i++) {
        status = fcsl_ring_front(&recorder->ring, &record, &data);
        if (status != FCSL_RING_RECORD) {
            break;
        }
        if (!atomic_load_explicit(&recorder->failed, memory_order_relaxed)) {
            note_failure(recorder, put_record(recorder, &record, data));
            *unflushed = 1;
        }
        if (atomic_load_explicit(&recorder->failed, memory_order_relaxed)) {
            (void)atomic_fetch_add_explicit(&recorder->disk_failed, 1, memory_order_relaxed);
        }
        fcsl_ring_pop(&recorder->ring);
    }
    fcsl_bag_unlock(recorder->bag);
    return status;
}

static uint64_t now_s(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
    return (uint64_t)now.tv_sec;
}

void *fcsl_recorder_run_writer(void *argument)
{
    fcsl_recorder_t *recorder = argument;
    uint64_t flushed_s = 0; /* the first record, a checkpoint, is handed on at once, as a chunk of its own */
    int unflushed = 0;
    fcsl_ring_status_t status = FCSL_RING_EMPTY;
    while ((status = write_batch(recorder, flushed_s == 0 ? 1 : BATCH_RECORDS, &unflushed)) != FCSL_RING_ENDED) {
        if (unflushed && !atomic_load(&recorder->failed) && now_s() != flushed_s) {
            note_failure(recorder, fcsl_bag_flush(recorder->bag, &recorder->failure));
            /* Should this fail, the file is as good as before; closing writes it once more, and says if that fails. */
            (void)fcsl_bag_write_metadata(recorder->bag, NULL);
            flushed_s = now_s();
            unflushed = 0;
        }
        if (status == FCSL_RING_EMPTY) {
            fcsl_ring_nap(&recorder->ring);
        }
    }
    return NULL;
}
