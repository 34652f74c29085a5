/* SPDX-License-Identifier: Apache-2.0
 *
 * The ring between the step thread and the writer of the bag.
 */
#define _GNU_SOURCE
#include "ring.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "fcsl/fcsl_monotonic.h"

/* The consumer looks by itself this often, so that a producer at moderate rates never makes a system call. */
enum { POLL_NS = 10000000 };
enum { HUGE_PAGE_BYTES = 2 << 20 };
_Static_assert(FCSL_RING_ALIGNMENT == 32, "the size of a record header is a power of two");

/* A record of this kind only fills the rest of the ring, because the next one must be contiguous. */
#define FILLER UINT32_MAX

int fcsl_ring_open(fcsl_ring_t *ring, size_t capacity)
{
    size_t rounded = 4096;
    while (rounded < capacity) {
        rounded *= 2;
    }
    memset(ring, 0, sizeof *ring);
    ring->capacity = rounded;
    ring->wake_at = rounded / 4u;
    const size_t aligned = rounded < HUGE_PAGE_BYTES ? rounded : HUGE_PAGE_BYTES;
    ring->bytes = aligned_alloc(aligned, rounded);
    if (ring->bytes == NULL) {
        return -1;
    }
    /* A tick writes where none has for seconds: with fewer pages it walks fewer page tables. The kernel may refuse. */
    (void)madvise(ring->bytes, rounded, MADV_HUGEPAGE);
    if (sem_init(&ring->wake_consumer, 0, 0) != 0) {
        free(ring->bytes);
        return -1;
    }
    if (sem_init(&ring->wake_producer, 0, 0) != 0) {
        (void)sem_destroy(&ring->wake_consumer);
        free(ring->bytes);
        return -1;
    }
    /* Touch every page now: the step thread shall not fault them in. */
    memset(ring->bytes, 1, rounded);
    return 0;
}

void fcsl_ring_free(fcsl_ring_t *ring)
{
    (void)sem_destroy(&ring->wake_consumer);
    (void)sem_destroy(&ring->wake_producer);
    free(ring->bytes);
    ring->bytes = NULL;
}

static void sleep_on(sem_t *semaphore)
{
    while (sem_wait(semaphore) != 0 && errno == EINTR) {
    }
}

/* Returns early when woken; the caller looks again in any case. */
static void nap_on(sem_t *semaphore)
{
    const struct timespec until = fcsl_timespec_of(fcsl_monotonic_ns() + POLL_NS);
    (void)sem_clockwait(semaphore, CLOCK_MONOTONIC, &until);
}

static void wake_if(atomic_int *sleeps, sem_t *semaphore)
{
    if (atomic_exchange(sleeps, 0)) {
        (void)sem_post(semaphore);
    }
}

/* Whether `needed` bytes are free; asks the consumer's tail only when the one last seen does not do. */
static int has_room(fcsl_ring_t *ring, uint64_t head, size_t needed)
{
    if (head + needed - ring->seen_tail <= ring->capacity) {
        return 1;
    }
    ring->seen_tail = atomic_load(&ring->tail);
    return head + needed - ring->seen_tail <= ring->capacity;
}

/* Waits until `needed` bytes are free. The sleep flag is set before the second look, and the consumer reads it after
 * publishing its tail, so one of the two always sees the other (all sequentially consistent). */
static void wait_for_room(fcsl_ring_t *ring, uint64_t head, size_t needed)
{
    while (!has_room(ring, head, needed)) {
        wake_if(&ring->consumer_sleeps, &ring->wake_consumer);
        atomic_store(&ring->producer_sleeps, 1);
        if (!has_room(ring, head, needed)) {
            sleep_on(&ring->wake_producer);
        }
        atomic_store(&ring->producer_sleeps, 0);
    }
}

static uint64_t least(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

uint8_t *fcsl_ring_claim_beyond(fcsl_ring_t *ring, const fcsl_record_t *record, fcsl_ring_policy_t policy)
{
    const size_t bytes = fcsl_ring_record_bytes(record->size);
    if (bytes > ring->capacity / 2) {
        return NULL;
    }
    uint64_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    if (head >= ring->wake_at) {
        ring->wake_at = head + ring->capacity / 4u;
        wake_if(&ring->consumer_sleeps, &ring->wake_consumer);
    }
    const size_t at = (size_t)(head & (ring->capacity - 1u));
    const size_t filler = ring->capacity - at < bytes ? ring->capacity - at : 0;
    const size_t kept = ring->capacity / 8u;
    if (policy == FCSL_RING_WAIT) {
        wait_for_room(ring, head, filler + bytes);
    } else if (!has_room(ring, head, filler + bytes + (policy == FCSL_RING_DROP ? 0 : kept))) {
        return NULL;
    }
    if (filler > 0) {
        const fcsl_record_t skip = {.size = (uint32_t)(filler - sizeof skip), .kind = FILLER};
        memcpy(ring->bytes + at, &skip, sizeof skip);
        head += filler;
    }
    const size_t begin = (size_t)(head & (ring->capacity - 1u));
    memcpy(ring->bytes + begin, record, sizeof *record);
    ring->claimed = head + bytes;
    ring->sure = least(least(ring->seen_tail + ring->capacity - kept, head - begin + ring->capacity), ring->wake_at);
    return ring->bytes + begin + sizeof *record;
}

void fcsl_ring_wake(fcsl_ring_t *ring)
{
    wake_if(&ring->consumer_sleeps, &ring->wake_consumer);
}

void fcsl_ring_end(fcsl_ring_t *ring)
{
    atomic_store(&ring->closed, 1);
    wake_if(&ring->consumer_sleeps, &ring->wake_consumer);
}

static int is_empty(fcsl_ring_t *ring, uint64_t tail)
{
    if (ring->seen_head == tail) {
        ring->seen_head = atomic_load(&ring->head);
    }
    return ring->seen_head == tail;
}

fcsl_ring_status_t fcsl_ring_front(fcsl_ring_t *ring, fcsl_record_t *record, const uint8_t **data)
{
    const uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    /* Closed is read before head: what was published before the end is seen. */
    const int closed = atomic_load_explicit(&ring->closed, memory_order_acquire);
    if (is_empty(ring, tail)) {
        return closed ? FCSL_RING_ENDED : FCSL_RING_EMPTY;
    }
    const uint8_t *in = ring->bytes + (size_t)(tail & (ring->capacity - 1u));
    memcpy(record, in, sizeof *record);
    if (record->kind == FILLER) {
        fcsl_ring_pop(ring);
        /* A filler is published together with the record behind it. */
        in = ring->bytes;
        memcpy(record, in, sizeof *record);
    }
    *data = in + sizeof *record;
    return FCSL_RING_RECORD;
}

void fcsl_ring_pop(fcsl_ring_t *ring)
{
    uint64_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    fcsl_record_t record;
    memcpy(&record, ring->bytes + (size_t)(tail & (ring->capacity - 1u)), sizeof record);
    tail += fcsl_ring_record_bytes(record.size);
    atomic_store(&ring->tail, tail);
    /* Half of the ring at a time: a producer that waits is not woken for every record. */
    if (atomic_load(&ring->producer_sleeps) && atomic_load(&ring->head) - tail <= ring->capacity / 2u) {
        wake_if(&ring->producer_sleeps, &ring->wake_producer);
    }
}

void fcsl_ring_nap(fcsl_ring_t *ring)
{
    atomic_store(&ring->consumer_sleeps, 1);
    if (atomic_load(&ring->head) == atomic_load_explicit(&ring->tail, memory_order_relaxed) &&
        !atomic_load(&ring->closed)) {
        nap_on(&ring->wake_consumer);
    }
    atomic_store(&ring->consumer_sleeps, 0);
}
