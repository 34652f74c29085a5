/* SPDX-License-Identifier: Apache-2.0
 *
 * A bounded binary heap of events, ordered by time, priority and sequence.
 */
#include "event_queue.h"

#include <stdlib.h>

int fcsl_event_queue_init(fcsl_event_queue_t *queue, uint32_t capacity)
{
    *queue = (fcsl_event_queue_t){0};
    queue->events = calloc(capacity ? capacity : 1, sizeof *queue->events);
    if (!queue->events) {
        return -1;
    }
    queue->capacity = capacity;
    return 0;
}

void fcsl_event_queue_free(fcsl_event_queue_t *queue)
{
    free(queue->events);
    *queue = (fcsl_event_queue_t){0};
}

static int comes_first(const fcsl_queued_event_t *a, const fcsl_queued_event_t *b)
{
    if (a->time_ns != b->time_ns) {
        return a->time_ns < b->time_ns;
    }
    if (a->priority != b->priority) {
        return a->priority < b->priority;
    }
    return a->sequence < b->sequence;
}

int fcsl_event_queue_push(fcsl_event_queue_t *queue, fcsl_queued_event_t event)
{
    if (queue->count >= queue->capacity) {
        return -1;
    }
    event.sequence = queue->next_sequence++;
    uint32_t hole = queue->count++;
    while (hole > 0) {
        uint32_t parent = (hole - 1) / 2;
        if (!comes_first(&event, &queue->events[parent])) {
            break;
        }
        queue->events[hole] = queue->events[parent];
        hole = parent;
    }
    queue->events[hole] = event;
    return 0;
}

int fcsl_event_queue_peek(const fcsl_event_queue_t *queue, fcsl_queued_event_t *event)
{
    if (queue->count == 0) {
        return -1;
    }
    *event = queue->events[0];
    return 0;
}

int fcsl_event_queue_pop(fcsl_event_queue_t *queue, fcsl_queued_event_t *event)
{
    if (queue->count == 0) {
        return -1;
    }
    *event = queue->events[0];
    const fcsl_queued_event_t last = queue->events[--queue->count];
    uint32_t hole = 0;
    for (;;) { /* at most log2(capacity) levels */
        uint32_t child = 2 * hole + 1;
        if (child >= queue->count) {
            break;
        }
        if (child + 1 < queue->count && comes_first(&queue->events[child + 1], &queue->events[child])) {
            child++;
        }
        if (!comes_first(&queue->events[child], &last)) {
            break;
        }
        queue->events[hole] = queue->events[child];
        hole = child;
    }
    if (queue->count) {
        queue->events[hole] = last;
    }
    return 0;
}
