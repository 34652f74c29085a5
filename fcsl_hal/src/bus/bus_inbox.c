/* SPDX-License-Identifier: Apache-2.0
 *
 * The inbox of bus_inbox.h: a queue of slots, or for the newest message alone a triple buffer.
 */
#include "bus_inbox.h"

#include <stdlib.h>
#include <string.h>

enum { LATEST_SLOTS = 3, SLOT_MASK = 3, NEW = 4 };

static uint32_t slot_count(uint32_t depth)
{
    return depth == 1 ? LATEST_SLOTS : depth;
}

uint64_t inbox_memory(uint32_t bytes, uint32_t depth)
{
    return (uint64_t)slot_count(depth) * (bytes + sizeof(uint32_t));
}

int inbox_open(inbox_t *inbox, uint32_t bytes, uint32_t least, uint32_t depth)
{
    *inbox = (inbox_t){.bytes = bytes, .least = least, .depth = depth, .back = 0, .front = 1, .middle = 2};
    inbox->slots = calloc(slot_count(depth), bytes);
    inbox->sizes = calloc(slot_count(depth), sizeof inbox->sizes[0]);
    return inbox->slots != NULL && inbox->sizes != NULL ? 0 : -1;
}

void inbox_close(inbox_t *inbox)
{
    free(inbox->slots);
    free(inbox->sizes);
}

static void fill(inbox_t *inbox, uint32_t slot, const uint8_t *bytes, size_t size)
{
    if (size > 0) {
        memcpy(inbox->slots + (size_t)slot * inbox->bytes, bytes, size);
    }
    inbox->sizes[slot] = (uint32_t)size;
}

static void copy(const inbox_t *inbox, uint32_t slot, void *bytes, size_t *size)
{
    *size = inbox->sizes[slot];
    memcpy(bytes, inbox->slots + (size_t)slot * inbox->bytes, *size);
}

inbox_result_t inbox_put(inbox_t *inbox, const uint8_t *bytes, size_t size)
{
    if (size > inbox->bytes || size < inbox->least) {
        return INBOX_WRONG_SIZE;
    }
    /* Before it takes a place: what nobody wants must not keep out what is waited for. */
    if (inbox->fits != NULL && !inbox->fits(inbox->what, bytes, size)) {
        return INBOX_MISFIT;
    }
    if (inbox->depth == 1) {
        fill(inbox, inbox->back, bytes, size);
        const uint32_t before = atomic_exchange_explicit(&inbox->middle, inbox->back | NEW, memory_order_acq_rel);
        inbox->back = before & SLOT_MASK;
        return (before & NEW) != 0 ? INBOX_REPLACED : INBOX_TAKEN;
    }
    const uint64_t head = atomic_load_explicit(&inbox->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&inbox->tail, memory_order_acquire) >= inbox->depth) {
        return INBOX_OVERFLOWED;
    }
    fill(inbox, (uint32_t)(head % inbox->depth), bytes, size);
    atomic_store_explicit(&inbox->head, head + 1u, memory_order_release);
    return INBOX_TAKEN;
}

int inbox_take(inbox_t *inbox, void *bytes, size_t *size)
{
    if (inbox->depth == 1) {
        if ((atomic_load_explicit(&inbox->middle, memory_order_relaxed) & NEW) == 0) {
            return 0;
        }
        inbox->front = atomic_exchange_explicit(&inbox->middle, inbox->front, memory_order_acq_rel) & SLOT_MASK;
        copy(inbox, inbox->front, bytes, size);
        return 1;
    }
    const uint64_t tail = atomic_load_explicit(&inbox->tail, memory_order_relaxed);
    if (tail == atomic_load_explicit(&inbox->head, memory_order_acquire)) {
        return 0;
    }
    copy(inbox, (uint32_t)(tail % inbox->depth), bytes, size);
    atomic_store_explicit(&inbox->tail, tail + 1u, memory_order_release);
    return 1;
}
