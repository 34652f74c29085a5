/* SPDX-License-Identifier: Apache-2.0
 *
 * A preallocated ring of records between one producer (the step thread) and one consumer (the bag's writer thread). The
 * producer never allocates and takes no lock: it copies, publishes, and wakes the consumer only when the ring fills up; the
 * consumer looks by itself every 10 ms.
 */
#ifndef FCSL_RING_H
#define FCSL_RING_H

#include <semaphore.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint64_t time_ns;
    uint32_t size; /* of the data that follows */
    uint32_t topic;
} fcsl_record_t;

typedef struct {
    uint8_t *bytes;
    size_t capacity; /* a power of two */
    _Atomic uint64_t head; /* bytes ever written; producer */
    _Atomic uint64_t tail; /* bytes ever consumed; consumer */
    atomic_int consumer_sleeps;
    atomic_int producer_sleeps;
    atomic_int closed;
    sem_t wake_consumer;
    sem_t wake_producer;
} fcsl_ring_t;

/* Rounds `capacity` up to a power of two; 0, or -1 without memory. */
int fcsl_ring_open(fcsl_ring_t *ring, size_t capacity);
void fcsl_ring_free(fcsl_ring_t *ring);

/* Producer. `wait` non-zero: waits for room; zero: returns -1 when there is none. A record larger than the ring: -1. */
int fcsl_ring_push(fcsl_ring_t *ring, const fcsl_record_t *record, const uint8_t *data, int wait);
/* Producer: no more records will come. */
void fcsl_ring_end(fcsl_ring_t *ring);

typedef enum { FCSL_RING_RECORD, FCSL_RING_IDLE, FCSL_RING_ENDED } fcsl_ring_status_t;

/* Consumer: points `data` at the oldest record, which stays valid until fcsl_ring_pop. Waits a moment for one (then IDLE);
 * ENDED once the ring is ended and empty. */
fcsl_ring_status_t fcsl_ring_front(fcsl_ring_t *ring, fcsl_record_t *record, const uint8_t **data);
void fcsl_ring_pop(fcsl_ring_t *ring);

#endif /* FCSL_RING_H */
