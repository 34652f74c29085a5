/* SPDX-License-Identifier: Apache-2.0
 *
 * A blob in a machine: a field u32[1 + N]. Element 0 is the number of bytes, at most N; each byte has an element of its own.
 */
#ifndef FCSL_CODEC_BLOB_H
#define FCSL_CODEC_BLOB_H

#include "fcsl/fcsl_scalar.h"

static inline uint32_t blob_capacity(const fcsl_field_t *field)
{
    return field->count - 1u;
}

/* Bytes of the blob at `in`. Every content of its field is a blob: a number above the capacity counts as the capacity. */
static inline uint32_t blob_count(const uint8_t *in, uint32_t capacity)
{
    uint32_t count = 0;
    memcpy(&count, in, sizeof count);
    return count < capacity ? count : capacity;
}

/* Writes the `count` bytes of the blob at `in`: the lower eight bits of their elements. */
static inline void blob_export(uint8_t *out, const uint8_t *in, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t element = 0;
        memcpy(&element, in + sizeof element * (i + 1u), sizeof element);
        out[i] = (uint8_t)element;
    }
}

/* Makes the field at `out` a blob of these bytes, at most its capacity; its other elements become 0. */
static inline void blob_import(uint8_t *out, const uint8_t *in, uint32_t count, uint32_t capacity)
{
    memcpy(out, &count, sizeof count);
    for (uint32_t i = 0; i < capacity; i++) {
        const uint32_t element = i < count ? in[i] : 0u;
        memcpy(out + sizeof element * (i + 1u), &element, sizeof element);
    }
}

#endif /* FCSL_CODEC_BLOB_H */
