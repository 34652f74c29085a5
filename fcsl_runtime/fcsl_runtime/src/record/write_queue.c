/* SPDX-License-Identifier: Apache-2.0
 *
 * Entries of the ring: number and write, then the data. Both ends are here.
 */
#include "write_queue.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_tick_time.h"
#include "machine/monitor_memory.h"

/* Of a message, besides data and names; and of the ring, of which an entry may take a half. */
enum { HEAD_BYTES = 512, RING_BYTES_MIN = 1 << 20, RING_MESSAGES = 4 };

typedef struct {
    uint64_t number;
    fcsl_write_t write; /* its `data` means nothing */
} entry_t;

/* ---- the thread that owns the run --------------------------------------------------------------------------------- */

/* That of a checkpoint or of a restore, or of a write with the longest name. */
static size_t longest_message(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor)
{
    size_t longest = strlen(machine->name);
    for (uint32_t i = 0; i < machine->field_count; i++) {
        const size_t length = strlen(machine->fields[i].path);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->state_count; i++) {
        const size_t length = strlen(machine->states[i].name);
        longest = length > longest ? length : longest;
    }
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        const size_t length = strlen(machine->channels[i].name);
        longest = length > longest ? length : longest;
    }
    return HEAD_BYTES + longest + machine->size + fcsl_monitor_memory_bytes(monitor);
}

fcsl_write_queue_t *fcsl_write_queue_open(const fcsl_machine_t *machine, const fcsl_monitor_t *monitor)
{
    fcsl_write_queue_t *queue = calloc(1, sizeof *queue);
    if (queue == NULL) {
        return NULL;
    }
    queue->machine = machine;
    queue->capacity = longest_message(machine, monitor);
    const size_t ring = RING_MESSAGES * queue->capacity;
    if (fcsl_ring_open(&queue->ring, ring > RING_BYTES_MIN ? ring : RING_BYTES_MIN) != 0) {
        free(queue);
        return NULL;
    }
    return queue;
}

void fcsl_write_queue_close(fcsl_write_queue_t *queue)
{
    if (queue != NULL) {
        fcsl_ring_free(&queue->ring);
        free(queue);
    }
}

uint64_t fcsl_write_queue_next_write(fcsl_write_queue_t *queue)
{
    const int requested = atomic_load_explicit(&queue->requested, memory_order_relaxed);
    queue->next += requested && !queue->enabled; /* an earlier reader finds the gap */
    queue->enabled = requested;
    return requested ? queue->next : 0;
}

void fcsl_write_queue_put(fcsl_write_queue_t *queue, uint64_t tick, const fcsl_write_t *write)
{
    const entry_t entry = {.number = queue->next++, .write = *write};
    const fcsl_record_t record = {.tick = tick, .size = (uint32_t)sizeof entry + write->size};
    uint8_t *out = fcsl_ring_claim(&queue->ring, &record, FCSL_RING_DROP);
    if (out == NULL) {
        return; /* the gap in the numbers shows it */
    }
    memcpy(out, &entry, sizeof entry);
    if (write->size > 0) {
        memcpy(out + sizeof entry, write->data, write->size);
    }
    fcsl_ring_publish(&queue->ring);
}

/* ---- the reading thread ----------------------------------------------------------------------------------------- */

void fcsl_write_queue_enable(fcsl_write_queue_t *queue, int enabled)
{
    atomic_store_explicit(&queue->requested, enabled, memory_order_relaxed);
}

size_t fcsl_write_queue_capacity(const fcsl_write_queue_t *queue)
{
    return queue->capacity;
}

static fcsl_stamp_t stamp_of(const fcsl_write_queue_t *queue, uint64_t tick)
{
    return (fcsl_stamp_t){.tick = tick, .time_ns = fcsl_tick_time_ns(queue->machine->tick_hz, tick)};
}

size_t fcsl_write_queue_take(fcsl_write_queue_t *queue, uint64_t end, uint64_t *number, uint8_t *bytes, size_t capacity)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    entry_t entry;
    if (fcsl_ring_front(&queue->ring, &record, &data) != FCSL_RING_RECORD) {
        return 0;
    }
    memcpy(&entry, data, sizeof entry);
    if (entry.number >= end) {
        return 0;
    }
    entry.write.data = data + sizeof entry;
    *number = entry.number;
    const size_t size = fcsl_write_message(&entry.write, stamp_of(queue, record.tick), bytes, capacity);
    fcsl_ring_pop(&queue->ring);
    return size;
}

void fcsl_write_queue_skip(fcsl_write_queue_t *queue)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    size_t passed = 0;
    while (passed < queue->ring.capacity && fcsl_ring_front(&queue->ring, &record, &data) == FCSL_RING_RECORD) {
        passed += record.size + sizeof record;
        fcsl_ring_pop(&queue->ring);
    }
}

size_t fcsl_write_queue_checkpoint(const fcsl_write_queue_t *queue, const void *data, uint64_t tick, uint8_t *bytes,
                                   size_t capacity)
{
    return fcsl_checkpoint_message(queue->machine, data, NULL, NULL, stamp_of(queue, tick), bytes, capacity);
}
