/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of one thread for another one, in their order, in a ring of bytes. Neither side waits.
 *
 * `head` and `tail` count bytes and never wrap. Each has one thread that stores it, behind the bytes of the message, and the other
 * loads it with acquire before it touches them: a message is read when it is whole, and its place is used again when it has been
 * popped. Release would do for that; head is stored sequentially consistent because of bus_event.h, by which the reader sleeps.
 */
#ifndef FCSL_BUS_RING_H
#define FCSL_BUS_RING_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint8_t *bytes;
    uint64_t capacity;
    _Atomic uint64_t head; /* bytes that were ever written, by the one side */
    _Atomic uint64_t tail; /* bytes that were ever read, by the other */
} ring_t;

/* 0, or -1 when there is no memory. */
int ring_open(ring_t *ring, uint32_t capacity);
void ring_close(ring_t *ring);

/* Appends a message: 0, or -1 when there is no room for it. */
int ring_push(ring_t *ring, uint32_t output, const void *bytes, size_t size);

/* The oldest message, where it lies until ring_pop: 1. 0: there is none. */
int ring_front(ring_t *ring, uint32_t *output, const uint8_t **bytes, size_t *size);
void ring_pop(ring_t *ring);

#endif /* FCSL_BUS_RING_H */
