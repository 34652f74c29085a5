/* SPDX-License-Identifier: Apache-2.0
 *
 * A ring of bytes of fixed size. Callers check for room first.
 */
#ifndef FCSL_LINK_BYTES_H
#define FCSL_LINK_BYTES_H

#include "fcsl/fcsl_link.h"

#include <string.h>

static inline uint32_t fcsl_link_bytes_room(const fcsl_link_bytes_t *ring)
{
    return FCSL_LINK_BUFFER - ring->size;
}

/* Writes `size` bytes at `offset` from the first one. */
static inline void fcsl_link_bytes_write(fcsl_link_bytes_t *ring, uint32_t offset, const uint8_t *in, uint32_t size)
{
    const uint32_t at = (ring->first + offset) % FCSL_LINK_BUFFER;
    const uint32_t straight = size < FCSL_LINK_BUFFER - at ? size : FCSL_LINK_BUFFER - at;
    if (size > 0) {
        memcpy(ring->bytes + at, in, straight);
        memcpy(ring->bytes, in + straight, size - straight);
    }
}

static inline void fcsl_link_bytes_append(fcsl_link_bytes_t *ring, const uint8_t *in, uint32_t size)
{
    fcsl_link_bytes_write(ring, ring->size, in, size);
    ring->size += size;
}

static inline void fcsl_link_bytes_read(const fcsl_link_bytes_t *ring, uint32_t offset, uint8_t *out, uint32_t size)
{
    const uint32_t at = (ring->first + offset) % FCSL_LINK_BUFFER;
    const uint32_t straight = size < FCSL_LINK_BUFFER - at ? size : FCSL_LINK_BUFFER - at;
    if (size > 0) {
        memcpy(out, ring->bytes + at, straight);
        memcpy(out + straight, ring->bytes, size - straight);
    }
}

/* Removes the first `size` bytes. */
static inline void fcsl_link_bytes_pop(fcsl_link_bytes_t *ring, uint32_t size)
{
    ring->first = (ring->first + size) % FCSL_LINK_BUFFER;
    ring->size -= size;
}

#endif /* FCSL_LINK_BYTES_H */
