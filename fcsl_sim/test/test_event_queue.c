/* SPDX-License-Identifier: Apache-2.0
 *
 * The queue's order is total: by time, then priority, then the order of pushing.
 */
#include <stdint.h>

#include "check.h"
#include "engine/event_queue.h"

enum { EVENTS = 500 };

static int is_before(const fcsl_queued_event_t *a, const fcsl_queued_event_t *b)
{
    return a->time_ns != b->time_ns     ? a->time_ns < b->time_ns
           : a->priority != b->priority ? a->priority < b->priority
                                        : a->sequence < b->sequence;
}

/* Few distinct times and priorities, so that ties are frequent. */
static fcsl_queued_event_t random_event(uint64_t *random, uint32_t index)
{
    return (fcsl_queued_event_t){.time_ns = (int64_t)(next_random(random) % 7) - 3,
                                 .priority = (uint32_t)(next_random(random) % 3),
                                 .index = index};
}

static void pops_in_order(void)
{
    fcsl_event_queue_t queue;
    uint64_t random = 1;
    CHECK(fcsl_event_queue_init(&queue, EVENTS) == 0);
    for (int round = 0; round < 20; round++) {
        for (uint32_t i = 0; i < EVENTS; i++) {
            CHECK(fcsl_event_queue_push(&queue, random_event(&random, i)) == 0);
        }
        uint8_t seen[EVENTS] = {0};
        fcsl_queued_event_t last = {0};
        for (uint32_t i = 0; i < EVENTS; i++) {
            fcsl_queued_event_t event;
            CHECK(fcsl_event_queue_pop(&queue, &event) == 0);
            CHECK(i == 0 || is_before(&last, &event));
            CHECK(!seen[event.index]);
            seen[event.index] = 1;
            last = event;
        }
    }
    fcsl_event_queue_free(&queue);
}

/* Pushes and pops mixed: a popped event is never later than the remaining ones. */
static void pops_the_first(void)
{
    fcsl_event_queue_t queue;
    uint64_t random = 2;
    CHECK(fcsl_event_queue_init(&queue, EVENTS) == 0);
    for (uint32_t step = 0; step < 20000; step++) {
        if (queue.count < EVENTS && (queue.count == 0 || next_random(&random) % 2)) {
            CHECK(fcsl_event_queue_push(&queue, random_event(&random, step)) == 0);
            continue;
        }
        fcsl_queued_event_t event;
        CHECK(fcsl_event_queue_pop(&queue, &event) == 0);
        for (uint32_t i = 0; i < queue.count; i++) {
            CHECK(is_before(&event, &queue.events[i]));
        }
    }
    fcsl_event_queue_free(&queue);
}

static void is_bounded(void)
{
    fcsl_event_queue_t queue;
    fcsl_queued_event_t event = {.time_ns = 5};
    CHECK(fcsl_event_queue_init(&queue, 2) == 0);
    CHECK(fcsl_event_queue_pop(&queue, &event) == -1);
    CHECK(fcsl_event_queue_push(&queue, event) == 0);
    CHECK(fcsl_event_queue_push(&queue, event) == 0);
    CHECK(fcsl_event_queue_push(&queue, event) == -1 && queue.count == 2);
    CHECK(fcsl_event_queue_pop(&queue, &event) == 0 && event.sequence == 0);
    CHECK(fcsl_event_queue_pop(&queue, &event) == 0 && event.sequence == 1);
    CHECK(fcsl_event_queue_pop(&queue, &event) == -1);
    fcsl_event_queue_free(&queue);
}

int main(void)
{
    pops_in_order();
    pops_the_first();
    is_bounded();
    return 0;
}
