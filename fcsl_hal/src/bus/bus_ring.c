/* SPDX-License-Identifier: Apache-2.0
 *
 * The ring of bus_ring.h. A message lies in one piece: where it does not fit before the end, a skip fills the end.
 */
#include "bus_ring.h"

#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 8 };
static const uint32_t SKIP = UINT32_MAX;

typedef struct {
    uint32_t output; /* or SKIP */
    uint32_t size;
} entry_t;

static uint64_t entry_bytes(size_t size)
{
    return sizeof(entry_t) + (size + ALIGNMENT - 1u) / ALIGNMENT * ALIGNMENT;
}

int ring_open(ring_t *ring, uint32_t capacity)
{
    *ring = (ring_t){.capacity = ((uint64_t)capacity + ALIGNMENT - 1u) / ALIGNMENT * ALIGNMENT};
    ring->bytes = calloc(1, ring->capacity);
    return ring->bytes != NULL ? 0 : -1;
}

void ring_close(ring_t *ring)
{
    free(ring->bytes);
}

int ring_push(ring_t *ring, uint32_t output, const void *bytes, size_t size)
{
    uint64_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    const uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    /* With half of the ring at most, a message finds its place in an empty ring wherever that stands. */
    if (size > ring->capacity / 2u || entry_bytes(size) > ring->capacity / 2u) {
        return -1;
    }
    const uint64_t at = head % ring->capacity;
    const uint64_t skipped = at + entry_bytes(size) > ring->capacity ? ring->capacity - at : 0u;
    if (head - tail + skipped + entry_bytes(size) > ring->capacity) {
        return -1;
    }
    if (skipped > 0) {
        const entry_t skip = {.output = SKIP};
        memcpy(ring->bytes + at, &skip, sizeof skip);
        head += skipped;
    }
    const entry_t entry = {.output = output, .size = (uint32_t)size};
    uint8_t *place = ring->bytes + head % ring->capacity;
    memcpy(place, &entry, sizeof entry);
    if (size > 0) {
        memcpy(place + sizeof entry, bytes, size);
    }
    /* Sequentially consistent: bus_event.h says why. */
    atomic_store(&ring->head, head + entry_bytes(size));
    return 0;
}

int ring_front(ring_t *ring, uint32_t *output, const uint8_t **bytes, size_t *size)
{
    uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    if (tail == atomic_load(&ring->head)) {
        return 0;
    }
    entry_t entry;
    memcpy(&entry, ring->bytes + tail % ring->capacity, sizeof entry);
    if (entry.output == SKIP) { /* a message stands behind it */
        tail += ring->capacity - tail % ring->capacity;
        atomic_store_explicit(&ring->tail, tail, memory_order_release);
        memcpy(&entry, ring->bytes, sizeof entry);
    }
    *output = entry.output;
    *bytes = ring->bytes + tail % ring->capacity + sizeof entry;
    *size = entry.size;
    return 1;
}

void ring_pop(ring_t *ring)
{
    const uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    entry_t entry;
    memcpy(&entry, ring->bytes + tail % ring->capacity, sizeof entry);
    atomic_store_explicit(&ring->tail, tail + entry_bytes(entry.size), memory_order_release);
}
