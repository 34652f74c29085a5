/* SPDX-License-Identifier: Apache-2.0
 *
 * A buffer of three slots.
 */
#include "triple_buffer.h"

#include <stdlib.h>

enum { SLOT = 3, FRESH = 4 };

int triple_buffer_open(triple_buffer_t *buffer, size_t size)
{
    *buffer = (triple_buffer_t){.slots = calloc(TRIPLE_BUFFER_SLOTS, size), .slot_size = size, .back = 0, .front = 1};
    atomic_init(&buffer->middle, 2u);
    return buffer->slots != NULL ? 0 : -1;
}

void triple_buffer_close(triple_buffer_t *buffer)
{
    free(buffer->slots);
    buffer->slots = NULL;
}

void *triple_buffer_back(const triple_buffer_t *buffer)
{
    return buffer->slots + buffer->back * buffer->slot_size;
}

int triple_buffer_put(triple_buffer_t *buffer)
{
    buffer->numbers[buffer->back] = ++buffer->puts;
    const uint32_t before = atomic_exchange_explicit(&buffer->middle, buffer->back | FRESH, memory_order_acq_rel);
    buffer->back = before & SLOT;
    return (before & FRESH) == 0u;
}

uint64_t triple_buffer_take(triple_buffer_t *buffer)
{
    if ((atomic_load_explicit(&buffer->middle, memory_order_relaxed) & FRESH) == 0u) {
        return 0;
    }
    buffer->front = atomic_exchange_explicit(&buffer->middle, buffer->front, memory_order_acq_rel) & SLOT;
    return buffer->numbers[buffer->front];
}

const void *triple_buffer_front(const triple_buffer_t *buffer)
{
    return buffer->slots + buffer->front * buffer->slot_size;
}
