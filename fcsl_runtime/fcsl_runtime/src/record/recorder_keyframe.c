/* SPDX-License-Identifier: Apache-2.0
 *
 * Keyframes: checkpoints in the middle of a recording, at which a replay may begin, and which it checks. They are what is
 * left to go on from when host writes are missing: word of these comes first, and a keyframe as soon as there is room.
 *
 * A keyframe is due when
 *   - KEYFRAME_SECONDS have passed, and the ticks since the last one have put SHARE times its bytes into the ring: large
 *     machines of which little is recorded have fewer, and the bag grows by a few percent at most;
 *   - the machine changes its state, if a quarter of that has passed;
 *   - host writes were lost.
 * Without room it is counted and left out, and due again after that quarter: the last eighth of the ring is for host writes.
 * A lossless recording waits, as it does for ticks, so that equal runs make equal bags.
 */
#include <string.h>

#include "machine/machine_struct.h"
#include "recorder.h"
#include "recorder_internal.h"

enum { KEYFRAME_SECONDS = 1, SHARE = 32, QUARTER = 4 };

static uint32_t monitor_bytes(const fcsl_recorder_t *recorder)
{
    return recorder->verdicts.monitor != NULL ? recorder->verdicts.monitor->machine->size : 0u;
}

void fcsl_recorder_choose_keyframes(fcsl_recorder_t *recorder)
{
    const uint64_t bytes = (uint64_t)recorder->machine->size + monitor_bytes(recorder);
    const uint64_t tick_bytes = fcsl_ring_record_bytes(recorder->range_bytes);
    const uint64_t paid = (SHARE * bytes + tick_bytes - 1u) / tick_bytes;
    const uint64_t usual = KEYFRAME_SECONDS * (uint64_t)recorder->machine->tick_hz;
    recorder->keyframe_ticks = paid > usual ? paid : usual;
}

int fcsl_recorder_checkpoint(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, fcsl_ring_policy_t policy)
{
    const uint32_t size = recorder->machine->size;
    const uint32_t remembered = monitor_bytes(recorder);
    const fcsl_record_t record = {
        .tick = stamp.tick, .time_ns = stamp.time_ns, .size = size + remembered, .kind = FCSL_RECORD_CHECKPOINT};
    uint8_t *out = fcsl_recorder_claim(recorder, &record, policy);
    if (out == NULL) {
        return -1;
    }
    memcpy(out, recorder->live, size);
    if (remembered > 0) {
        memcpy(out + size, recorder->remembered, remembered);
    }
    fcsl_ring_publish(&recorder->ring);
    return 0;
}

static int changes_state(const fcsl_recorder_t *recorder)
{
    const fcsl_machine_t *machine = recorder->machine;
    return fcsl_read_i32(recorder->live, machine->state_offset) !=
           fcsl_read_i32(recorder->live, machine->next_state_offset);
}

__attribute__((hot)) void fcsl_recorder_end_tick(fcsl_recorder_t *recorder, fcsl_stamp_t next)
{
    const uint64_t quarter = recorder->keyframe_ticks / QUARTER;
    recorder->keyframe_age++;
    if (recorder->keyframe_age < recorder->keyframe_ticks &&
        (recorder->keyframe_age < quarter || !changes_state(recorder))) {
        return;
    }
    if (fcsl_recorder_checkpoint(recorder, next, recorder->tick_policy) == 0) {
        recorder->keyframe_age = 0;
        return;
    }
    const uint64_t count = atomic_load_explicit(&recorder->keyframes_dropped, memory_order_relaxed);
    atomic_store_explicit(&recorder->keyframes_dropped, count + 1u, memory_order_relaxed);
    recorder->keyframe_age = recorder->keyframe_ticks - quarter;
}

/* Word of host writes that found no room, before anything that comes behind them. */
static int put_lost(fcsl_recorder_t *recorder)
{
    const fcsl_write_t lost = {.kind = FCSL_WRITE_LOST, .path = "", .element = recorder->lost_writes};
    const fcsl_record_t record = {.tick = recorder->first_lost.tick,
                                  .time_ns = recorder->first_lost.time_ns,
                                  .size = sizeof lost,
                                  .kind = FCSL_RECORD_WRITE};
    uint8_t *out = fcsl_ring_claim(&recorder->ring, &record, FCSL_RING_DROP);
    if (out == NULL) {
        return -1;
    }
    memcpy(out, &lost, sizeof lost);
    fcsl_ring_publish(&recorder->ring);
    recorder->lost_writes = 0;
    recorder->keyframe_age = recorder->keyframe_ticks;
    return 0;
}

uint8_t *fcsl_recorder_claim(fcsl_recorder_t *recorder, const fcsl_record_t *record, fcsl_ring_policy_t policy)
{
    if (__builtin_expect(recorder->lost_writes != 0, 0) && put_lost(recorder) != 0) {
        return NULL;
    }
    return fcsl_ring_claim(&recorder->ring, record, policy);
}
