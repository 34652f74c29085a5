/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages between the thread that steps and the one that publishes: the recorder's ring, seen as a queue of messages.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_publish_queue.h"
#include "fcsl/fcsl_scalar.h"
#include "record/ring.h"

/* A message takes half of the ring at most, and so fits what fcsl_publish_queue_take writes. */
enum { RING_BYTES = 2 * FCSL_PUBLISH_QUEUE_TAKE_MAX, BATCH_BYTES = 64 << 10, HEAD_BYTES = 8, ALIGNMENT = 8 };

struct fcsl_publish_queue {
    fcsl_ring_t ring;
    int lossless;
    _Atomic uint64_t dropped;
};

fcsl_publish_queue_t *fcsl_publish_queue_new(int lossless, fcsl_error_t *error)
{
    fcsl_publish_queue_t *queue = calloc(1, sizeof *queue);
    if (queue == NULL || fcsl_ring_open(&queue->ring, RING_BYTES) != 0) {
        free(queue);
        (void)fcsl_fail(error, "out of memory for messages to publish");
        return NULL;
    }
    queue->lossless = lossless;
    return queue;
}

void fcsl_publish_queue_free(fcsl_publish_queue_t *queue)
{
    fcsl_ring_free(&queue->ring);
    free(queue);
}

uint8_t *fcsl_publish_queue_claim(fcsl_publish_queue_t *queue, uint32_t topic, uint32_t size,
                                  fcsl_publish_queue_kind_t kind)
{
    const fcsl_record_t record = {.size = size, .kind = topic};
    const fcsl_ring_policy_t policy = queue->lossless                     ? FCSL_RING_WAIT
                                      : kind == FCSL_PUBLISH_QUEUE_STREAM ? FCSL_RING_DROP_EARLIER
                                                                          : FCSL_RING_DROP;
    const int fits = size <= FCSL_PUBLISH_QUEUE_TAKE_MAX - HEAD_BYTES - ALIGNMENT;
    uint8_t *place = fits ? fcsl_ring_claim(&queue->ring, &record, policy) : NULL;
    if (place == NULL) {
        (void)atomic_fetch_add_explicit(&queue->dropped, 1, memory_order_relaxed);
    }
    return place;
}

void fcsl_publish_queue_put(fcsl_publish_queue_t *queue)
{
    fcsl_ring_publish(&queue->ring);
}

void fcsl_publish_queue_wake(fcsl_publish_queue_t *queue)
{
    fcsl_ring_wake(&queue->ring);
}

static size_t padded(uint32_t size)
{
    return HEAD_BYTES + ((size_t)size + ALIGNMENT - 1u) / ALIGNMENT * ALIGNMENT;
}

size_t fcsl_publish_queue_take(fcsl_publish_queue_t *queue, int wait, uint8_t *bytes)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    size_t taken = 0;
    if (wait && fcsl_ring_front(&queue->ring, &record, &data) != FCSL_RING_RECORD) {
        fcsl_ring_nap(&queue->ring);
    }
    while (taken < BATCH_BYTES && fcsl_ring_front(&queue->ring, &record, &data) == FCSL_RING_RECORD) {
        const size_t room = padded(record.size);
        if (taken + room > FCSL_PUBLISH_QUEUE_TAKE_MAX) {
            break;
        }
        fcsl_put_u32(bytes + taken, record.kind);
        fcsl_put_u32(bytes + taken + 4, record.size);
        memcpy(bytes + taken + HEAD_BYTES, data, record.size);
        memset(bytes + taken + HEAD_BYTES + record.size, 0, room - HEAD_BYTES - record.size);
        fcsl_ring_pop(&queue->ring);
        taken += room;
    }
    return taken;
}

uint64_t fcsl_publish_queue_dropped(const fcsl_publish_queue_t *queue)
{
    return atomic_load_explicit(&queue->dropped, memory_order_relaxed);
}
