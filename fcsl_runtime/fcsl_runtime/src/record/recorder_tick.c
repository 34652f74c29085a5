/* SPDX-License-Identifier: Apache-2.0
 *
 * What the thread that owns the run does for the record: it copies into the ring. Nothing here looks at the values.
 */
#include <stdlib.h>

#include "fcsl/fcsl_scalar.h"
#include "recorder.h"
#include "recorder_internal.h"

/* Whole blocks of the machine struct are copied: no call, no branch for each size. */
enum { BLOCK_BYTES = FCSL_RING_ALIGNMENT };

/* Room for one record, or null when there is none, which is counted. */
static uint8_t *claim(fcsl_recorder_t *recorder, const fcsl_record_t *record, fcsl_ring_policy_t policy)
{
    uint8_t *out = fcsl_recorder_claim(recorder, record, policy);
    if (out == NULL) {
        const uint64_t count = atomic_load_explicit(&recorder->ring_full, memory_order_relaxed);
        atomic_store_explicit(&recorder->ring_full, count + 1u, memory_order_relaxed);
    }
    return out;
}

static uint8_t *claim_tick(fcsl_recorder_t *recorder, uint32_t kind, fcsl_stamp_t stamp, uint32_t size,
                           fcsl_ring_policy_t policy)
{
    const fcsl_record_t record = {.tick = stamp.tick, .time_ns = stamp.time_ns, .size = size, .kind = kind};
    return claim(recorder, &record, policy);
}

__attribute__((hot)) int fcsl_recorder_begin_tick(fcsl_recorder_t *recorder, fcsl_error_t *error)
{
    /* Nobody has been for seconds where this tick's record will go. It comes into the cache while the machine steps. */
    const fcsl_ring_t *ring = &recorder->ring;
    const uint64_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    const uint64_t end = head + recorder->range_bytes;
    for (uint64_t at = head; at < end; at += FCSL_RING_LINE_BYTES) {
        __builtin_prefetch(ring->bytes + (size_t)(at & (ring->capacity - 1u)), 1);
    }
    return recorder->tick_policy == FCSL_RING_WAIT ? fcsl_recorder_check(recorder, error) : 0;
}

static uint8_t *copy_blocks(uint8_t *restrict out, const uint8_t *restrict in, uint32_t size)
{
    for (const uint8_t *end = in + size; in != end; in += BLOCK_BYTES) {
        memcpy(out, in, BLOCK_BYTES);
        out += BLOCK_BYTES;
    }
    return out;
}

__attribute__((hot)) void fcsl_recorder_tick(fcsl_recorder_t *recorder, fcsl_stamp_t stamp)
{
    uint8_t *out = claim_tick(recorder, FCSL_RECORD_TICK, stamp, recorder->range_bytes, recorder->tick_policy);
    if (out != NULL) {
        const uint8_t *data = recorder->live;
        const fcsl_range_t *end = recorder->ranges + recorder->range_count;
        for (const fcsl_range_t *range = recorder->ranges; range != end; range++) {
            out = copy_blocks(out, data + range->offset, range->size);
        }
        fcsl_ring_publish(&recorder->ring);
    }
    recorder->stepped = 1;
}

int fcsl_recorder_verdicts(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *rows)
{
    const uint32_t size = fcsl_verdict_rows_bytes(&recorder->verdicts);
    uint8_t *out = claim_tick(recorder, FCSL_RECORD_VERDICTS, stamp, size, recorder->tick_policy);
    if (out == NULL) {
        return -1;
    }
    memcpy(out, rows, size);
    fcsl_ring_publish(&recorder->ring);
    return 0;
}

void fcsl_recorder_events(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_told_event_t *events,
                          uint32_t count)
{
    const uint32_t size = count * (uint32_t)sizeof *events;
    uint8_t *out = claim_tick(recorder, FCSL_RECORD_EVENTS, stamp, size, recorder->tick_policy);
    if (out != NULL) {
        memcpy(out, events, size);
        fcsl_ring_publish(&recorder->ring);
    }
}

void fcsl_recorder_write(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_write_t *write)
{
    const uint32_t size = (uint32_t)sizeof *write + write->size;
    uint8_t *out = claim_tick(recorder, FCSL_RECORD_WRITE, stamp, size, recorder->write_policy);
    if (out != NULL) {
        memcpy(out, write, sizeof *write);
        if (write->size > 0) {
            memcpy(out + sizeof *write, write->data, write->size);
        }
        fcsl_ring_publish(&recorder->ring);
    } else {
        recorder->first_lost = recorder->lost_writes == 0 ? stamp : recorder->first_lost;
        recorder->lost_writes += recorder->lost_writes < UINT32_MAX;
    }
}

void fcsl_recorder_forced(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_state_t *from,
                          const fcsl_state_t *to)
{
    const fcsl_state_t *states[] = {from, to};
    uint8_t *out = claim_tick(recorder, FCSL_RECORD_FORCED, stamp, sizeof states, recorder->write_policy);
    if (out != NULL) {
        memcpy(out, states, sizeof states);
        fcsl_ring_publish(&recorder->ring);
    }
}

int fcsl_recorder_message(fcsl_recorder_t *recorder, int topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                          fcsl_error_t *error)
{
    if (topic < (int)recorder->own_topics || (uint32_t)topic >= recorder->topic_count) {
        return fcsl_fail(error, "topic number %d was not added to this recording", topic);
    }
    if (size == 0 || size > recorder->ring.capacity / 4) {
        return fcsl_fail(error, "a message of %u bytes cannot be recorded", size);
    }
    if (fcsl_recorder_check(recorder, error) != 0) {
        return -1;
    }
    const fcsl_record_t record = {.time_ns = time_ns, .size = size, .kind = FCSL_RECORD_MESSAGE + (uint32_t)topic};
    uint8_t *out = claim(recorder, &record, recorder->tick_policy);
    if (out != NULL) {
        memcpy(out, cdr, size);
        fcsl_ring_publish(&recorder->ring);
    }
    return 0;
}

/* ---- what a tick copies ------------------------------------------------------------------------------------------- */

static int by_offset(const void *a, const void *b)
{
    const uint32_t x = ((const fcsl_range_t *)a)->offset;
    const uint32_t y = ((const fcsl_range_t *)b)->offset;
    return (x > y) - (x < y);
}

/* The blocks that a range touches; a machine struct has room for whole blocks. */
static fcsl_range_t whole_blocks(fcsl_range_t range)
{
    const uint32_t begin = range.offset / BLOCK_BYTES * BLOCK_BYTES;
    const uint32_t end = (range.offset + range.size + BLOCK_BYTES - 1u) / BLOCK_BYTES * BLOCK_BYTES;
    return (fcsl_range_t){begin, end - begin};
}

/* Makes whole blocks of ranges, in order, and one range of those that touch; returns how many are left. */
static uint32_t merge(fcsl_range_t *ranges, uint32_t count)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        ranges[i] = whole_blocks(ranges[i]);
    }
    qsort(ranges, count, sizeof *ranges, by_offset);
    for (uint32_t i = 1; i < count; i++) {
        fcsl_range_t *last = &ranges[kept];
        const uint32_t last_end = last->offset + last->size;
        const uint32_t end = ranges[i].offset + ranges[i].size;
        if (ranges[i].offset > last_end) {
            ranges[++kept] = ranges[i];
        } else if (end > last_end) {
            last->size = end - last->offset;
        }
    }
    return kept + 1u;
}

int fcsl_recorder_choose_ranges(fcsl_recorder_t *recorder, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = recorder->machine;
    size_t most = 3u + 5u * (size_t)machine->instance_count;
    for (uint32_t i = 0; i < recorder->shown_count; i++) {
        most += recorder->shown[i].layout.copy_count;
    }
    fcsl_range_t *ranges = malloc(most * sizeof *ranges);
    if (ranges == NULL) {
        return fcsl_fail(error, "out of memory for the recorder");
    }
    uint32_t count = 0;
    ranges[count++] = (fcsl_range_t){machine->state_offset, 4};
    ranges[count++] = (fcsl_range_t){machine->next_state_offset, 4};
    if (machine->after_ticks != NULL) {
        ranges[count++] = (fcsl_range_t){machine->ticks_in_state_offset, 8};
    }
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        ranges[count++] = (fcsl_range_t){instance->request_offset, 4};
        ranges[count++] = (fcsl_range_t){instance->health_offset, 4};
        ranges[count++] = (fcsl_range_t){instance->faults_offset, 8};
        ranges[count++] = (fcsl_range_t){instance->overruns_offset, 8};
        ranges[count++] = (fcsl_range_t){instance->fault_place_offset, 4};
    }
    for (uint32_t i = 0; i < recorder->shown_count; i++) {
        const fcsl_layout_t *layout = &recorder->shown[i].layout;
        for (uint32_t j = 0; j < layout->copy_count; j++) {
            const fcsl_copy_t *copy = &layout->copies[j];
            ranges[count++] = (fcsl_range_t){copy->source, copy->count * fcsl_scalar_size(copy->type)};
        }
    }
    recorder->ranges = ranges;
    recorder->range_count = merge(ranges, count);
    for (uint32_t i = 0; i < recorder->range_count; i++) {
        recorder->range_bytes += ranges[i].size;
    }
    return 0;
}
