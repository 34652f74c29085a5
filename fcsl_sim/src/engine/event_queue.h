/* SPDX-License-Identifier: Apache-2.0
 *
 * The event queue: a bounded binary heap, ordered by (time, priority, sequence). The sequence number is given at push,
 * so the order is total: two runs pop the same events in the same order.
 */
#ifndef FCSL_SIM_EVENT_QUEUE_H
#define FCSL_SIM_EVENT_QUEUE_H

#include <stdint.h>

typedef struct {
    int64_t time_ns;
    uint64_t sequence; /* set by push */
    uint32_t priority; /* smaller comes first */
    uint32_t kind;     /* for the caller */
    uint32_t index;    /* for the caller */
} fcsl_queued_event_t;

typedef struct {
    fcsl_queued_event_t *events;
    uint32_t count;
    uint32_t capacity;
    uint64_t next_sequence;
} fcsl_event_queue_t;

/* Allocates room for `capacity` events; the only allocation. Returns 0, or -1. */
int fcsl_event_queue_init(fcsl_event_queue_t *queue, uint32_t capacity);
void fcsl_event_queue_free(fcsl_event_queue_t *queue);

/* Returns 0, or -1 if the queue is full (nothing changes). */
int fcsl_event_queue_push(fcsl_event_queue_t *queue, fcsl_queued_event_t event);
/* The first event, which stays. Returns 0, or -1 if the queue is empty. */
int fcsl_event_queue_peek(const fcsl_event_queue_t *queue, fcsl_queued_event_t *event);
/* Removes the first event. Returns 0, or -1 if the queue is empty. */
int fcsl_event_queue_pop(fcsl_event_queue_t *queue, fcsl_queued_event_t *event);

#endif /* FCSL_SIM_EVENT_QUEUE_H */
