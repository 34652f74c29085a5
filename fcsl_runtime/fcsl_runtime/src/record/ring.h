/* SPDX-License-Identifier: Apache-2.0
 *
 * A preallocated ring of records between one producer (the step thread) and one consumer (the bag's writer thread). The
 * producer never allocates and takes no lock: it claims room, writes the record there, and publishes it. It looks at what
 * the consumer writes only when the room that it knows of is used up, and wakes the consumer once per quarter of the ring;
 * the consumer looks by itself every 10 ms.
 *
 * Both run in every tick of a recorded run, whose caches may be cold: the common way is short, and inline.
 */
#ifndef FCSL_RING_H
#define FCSL_RING_H

#include <semaphore.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The ring uses `size` alone; `kind` is any but UINT32_MAX. */
typedef struct {
    uint64_t tick;
    uint64_t time_ns;
    uint32_t size; /* of the data that follows */
    uint32_t kind;
    uint64_t padding; /* makes the size a power of two: a header never wraps around the end */
} fcsl_record_t;

/* Records begin at multiples of the record header, so a header never wraps around the end. */
enum { FCSL_RING_ALIGNMENT = sizeof(fcsl_record_t) };

/* What each of the two threads writes lies in cache lines of its own. */
enum { FCSL_RING_LINE_BYTES = 64 };

typedef struct {
    uint8_t *bytes;
    size_t capacity; /* a power of two */
    char after_constants[FCSL_RING_LINE_BYTES];
    _Atomic uint64_t head; /* bytes ever written; producer, as the next four */
    uint64_t claimed;      /* where head goes when the claimed record is published */
    uint64_t sure; /* records up to here find room, behind one another, for any policy; nobody is to be woken */
    uint64_t seen_tail;
    uint64_t wake_at; /* where head next wakes the consumer */
    char after_producer[FCSL_RING_LINE_BYTES];
    _Atomic uint64_t tail; /* bytes ever consumed; consumer, as the next */
    uint64_t seen_head;
    char after_consumer[FCSL_RING_LINE_BYTES];
    atomic_int consumer_sleeps;
    atomic_int producer_sleeps;
    atomic_int closed;
    sem_t wake_consumer;
    sem_t wake_producer;
} fcsl_ring_t;

/* Rounds `capacity` up to a power of two; 0, or -1 without memory. */
int fcsl_ring_open(fcsl_ring_t *ring, size_t capacity);
void fcsl_ring_free(fcsl_ring_t *ring);

/* What a producer does when there is no room. */
typedef enum {
    FCSL_RING_WAIT, /* until the consumer has made some */
    FCSL_RING_DROP, /* gives up */
    FCSL_RING_DROP_EARLIER /* gives up while there is still room for others: an eighth of the ring */
} fcsl_ring_policy_t;

static inline size_t fcsl_ring_record_bytes(uint32_t size)
{
    return FCSL_RING_ALIGNMENT + ((size_t)size + FCSL_RING_ALIGNMENT - 1u) / FCSL_RING_ALIGNMENT * FCSL_RING_ALIGNMENT;
}

/* fcsl_ring_claim beyond what is sure: looks at the consumer and goes around the end. */
uint8_t *fcsl_ring_claim_beyond(fcsl_ring_t *ring, const fcsl_record_t *record, fcsl_ring_policy_t policy);

/* Producer: returns where the `record->size` bytes of data go, or null when they find no room (for `policy`, or ever). What
 * was claimed is the consumer's once fcsl_ring_publish is called; the next claim comes after that. */
static inline uint8_t *fcsl_ring_claim(fcsl_ring_t *ring, const fcsl_record_t *record, fcsl_ring_policy_t policy)
{
    const uint64_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    const uint64_t end = head + fcsl_ring_record_bytes(record->size);
    if (__builtin_expect(end > ring->sure, 0)) {
        return fcsl_ring_claim_beyond(ring, record, policy);
    }
    uint8_t *out = ring->bytes + (size_t)(head & (ring->capacity - 1u));
    memcpy(out, record, sizeof *record);
    ring->claimed = end;
    return out + sizeof *record;
}

static inline void fcsl_ring_publish(fcsl_ring_t *ring)
{
    atomic_store_explicit(&ring->head, ring->claimed, memory_order_release);
}

/* Producer: ends the consumer's nap. */
void fcsl_ring_wake(fcsl_ring_t *ring);
/* Producer: no more records will come. */
void fcsl_ring_end(fcsl_ring_t *ring);

typedef enum { FCSL_RING_RECORD, FCSL_RING_EMPTY, FCSL_RING_ENDED } fcsl_ring_status_t;

/* Consumer: points `data` at the oldest record, which stays valid until fcsl_ring_pop. ENDED once the ring is ended and
 * empty. Never waits. */
fcsl_ring_status_t fcsl_ring_front(fcsl_ring_t *ring, fcsl_record_t *record, const uint8_t **data);
void fcsl_ring_pop(fcsl_ring_t *ring);
/* Consumer: waits a moment for a record. */
void fcsl_ring_nap(fcsl_ring_t *ring);

#endif /* FCSL_RING_H */
