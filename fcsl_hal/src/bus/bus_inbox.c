/* SPDX-License-Identifier: Apache-2.0
 *
 * The inbox of bus_inbox.h.
 */
#include "bus_inbox.h"

#include <stdlib.h>
#include <string.h>

static size_t slot_bytes(uint32_t bytes)
{
    return sizeof(uint32_t) + (size_t)bytes;
}

uint64_t inbox_memory(uint32_t bytes, uint32_t depth)
{
    return (uint64_t)(depth == 1 ? FCSL_LATEST_SLOTS : depth) * slot_bytes(bytes);
}

int inbox_open(inbox_t *inbox, uint32_t bytes, uint32_t least, uint32_t depth)
{
    *inbox = (inbox_t){.bytes = bytes, .least = least, .depth = depth};
    if (depth == 1) {
        return fcsl_latest_open(&inbox->latest, slot_bytes(bytes));
    }
    inbox->slots = calloc(depth, slot_bytes(bytes));
    return inbox->slots != NULL ? 0 : -1;
}

void inbox_close(inbox_t *inbox)
{
    fcsl_latest_close(&inbox->latest);
    free(inbox->slots);
}

static void fill(uint8_t *slot, const uint8_t *bytes, size_t size)
{
    const uint32_t stored = (uint32_t)size;
    memcpy(slot, &stored, sizeof stored);
    if (size > 0) {
        memcpy(slot + sizeof stored, bytes, size);
    }
}

static void copy(const uint8_t *slot, void *bytes, size_t *size)
{
    uint32_t stored = 0;
    memcpy(&stored, slot, sizeof stored);
    memcpy(bytes, slot + sizeof stored, stored);
    *size = stored;
}

static uint8_t *slot_of(const inbox_t *inbox, uint64_t message)
{
    return inbox->slots + (size_t)(message % inbox->depth) * slot_bytes(inbox->bytes);
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
        fill(fcsl_latest_back(&inbox->latest), bytes, size);
        return fcsl_latest_put(&inbox->latest) ? INBOX_TAKEN : INBOX_REPLACED;
    }
    const uint64_t head = atomic_load_explicit(&inbox->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&inbox->tail, memory_order_acquire) >= inbox->depth) {
        return INBOX_OVERFLOWED;
    }
    fill(slot_of(inbox, head), bytes, size);
    atomic_store_explicit(&inbox->head, head + 1u, memory_order_release);
    return INBOX_TAKEN;
}

int inbox_take(inbox_t *inbox, void *bytes, size_t *size)
{
    if (inbox->depth == 1) {
        if (fcsl_latest_take(&inbox->latest) == 0) {
            return 0;
        }
        copy(fcsl_latest_front(&inbox->latest), bytes, size);
        return 1;
    }
    const uint64_t tail = atomic_load_explicit(&inbox->tail, memory_order_relaxed);
    if (tail == atomic_load_explicit(&inbox->head, memory_order_acquire)) {
        return 0;
    }
    copy(slot_of(inbox, tail), bytes, size);
    atomic_store_explicit(&inbox->tail, tail + 1u, memory_order_release);
    return 1;
}
