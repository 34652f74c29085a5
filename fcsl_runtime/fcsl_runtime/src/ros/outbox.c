/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages between the thread that steps and the one that publishes: the recorder's ring, seen as a queue of messages.
 */
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_outbox.h"
#include "fcsl/fcsl_scalar.h"
#include "record/ring.h"

/* A message takes half of the ring at most, and so fits what fcsl_outbox_take writes. */
enum { RING_BYTES = 2 * FCSL_OUTBOX_TAKE_MAX, BATCH_BYTES = 64 << 10, HEAD_BYTES = 8, ALIGNMENT = 8 };

struct fcsl_outbox {
    fcsl_ring_t ring;
    int lossless;
    _Atomic uint64_t dropped;
};

fcsl_outbox_t *fcsl_outbox_new(int lossless, fcsl_error_t *error)
{
    fcsl_outbox_t *outbox = calloc(1, sizeof *outbox);
    if (outbox == NULL || fcsl_ring_open(&outbox->ring, RING_BYTES) != 0) {
        free(outbox);
        (void)fcsl_fail(error, "out of memory for messages to publish");
        return NULL;
    }
    outbox->lossless = lossless;
    return outbox;
}

void fcsl_outbox_free(fcsl_outbox_t *outbox)
{
    fcsl_ring_free(&outbox->ring);
    free(outbox);
}

uint8_t *fcsl_outbox_claim(fcsl_outbox_t *outbox, uint32_t topic, uint32_t size, fcsl_outbox_kind_t kind)
{
    const fcsl_record_t record = {.size = size, .kind = topic};
    const fcsl_ring_policy_t policy = outbox->lossless             ? FCSL_RING_WAIT
                                      : kind == FCSL_OUTBOX_STREAM ? FCSL_RING_DROP_EARLIER
                                                                   : FCSL_RING_DROP;
    const int fits = size <= FCSL_OUTBOX_TAKE_MAX - HEAD_BYTES - ALIGNMENT;
    uint8_t *place = fits ? fcsl_ring_claim(&outbox->ring, &record, policy) : NULL;
    if (place == NULL) {
        (void)atomic_fetch_add_explicit(&outbox->dropped, 1, memory_order_relaxed);
    }
    return place;
}

void fcsl_outbox_put(fcsl_outbox_t *outbox)
{
    fcsl_ring_publish(&outbox->ring);
}

void fcsl_outbox_wake(fcsl_outbox_t *outbox)
{
    fcsl_ring_wake(&outbox->ring);
}

static size_t padded(uint32_t size)
{
    return HEAD_BYTES + ((size_t)size + ALIGNMENT - 1u) / ALIGNMENT * ALIGNMENT;
}

size_t fcsl_outbox_take(fcsl_outbox_t *outbox, int wait, uint8_t *bytes)
{
    fcsl_record_t record;
    const uint8_t *data = NULL;
    size_t taken = 0;
    if (wait && fcsl_ring_front(&outbox->ring, &record, &data) != FCSL_RING_RECORD) {
        fcsl_ring_nap(&outbox->ring);
    }
    while (taken < BATCH_BYTES && fcsl_ring_front(&outbox->ring, &record, &data) == FCSL_RING_RECORD) {
        const size_t room = padded(record.size);
        if (taken + room > FCSL_OUTBOX_TAKE_MAX) {
            break;
        }
        fcsl_put_u32(bytes + taken, record.kind);
        fcsl_put_u32(bytes + taken + 4, record.size);
        memcpy(bytes + taken + HEAD_BYTES, data, record.size);
        memset(bytes + taken + HEAD_BYTES + record.size, 0, room - HEAD_BYTES - record.size);
        fcsl_ring_pop(&outbox->ring);
        taken += room;
    }
    return taken;
}

uint64_t fcsl_outbox_dropped(const fcsl_outbox_t *outbox)
{
    return atomic_load_explicit(&outbox->dropped, memory_order_relaxed);
}
