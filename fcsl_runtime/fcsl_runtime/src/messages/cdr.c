/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes CDR into a buffer of fixed size.
 */
#include "fcsl/fcsl_cdr.h"

#include <string.h>

#include "fcsl/fcsl_scalar.h"

/* Advances by `size` and returns where those bytes go, or null when they do not fit. */
static uint8_t *take(fcsl_cdr_t *cdr, size_t size)
{
    const size_t at = cdr->at;
    if (at > cdr->capacity || cdr->capacity - at < size) {
        cdr->at = SIZE_MAX;
        return NULL;
    }
    cdr->at = at + size;
    return cdr->bytes + at;
}

void fcsl_cdr_begin(fcsl_cdr_t *cdr, uint8_t *bytes, size_t capacity)
{
    static const uint8_t little_endian_cdr[FCSL_CDR_ENCAPSULATION_BYTES] = {0, 1, 0, 0};
    *cdr = (fcsl_cdr_t){.bytes = bytes, .capacity = capacity, .at = 0};
    uint8_t *out = take(cdr, sizeof little_endian_cdr);
    if (out != NULL) {
        memcpy(out, little_endian_cdr, sizeof little_endian_cdr);
    }
}

void fcsl_cdr_align(fcsl_cdr_t *cdr, size_t alignment)
{
    if (cdr->at > cdr->capacity) {
        return;
    }
    const size_t behind = (cdr->at - FCSL_CDR_ENCAPSULATION_BYTES) & (alignment - 1u);
    const size_t padding = behind == 0 ? 0 : alignment - behind;
    uint8_t *out = take(cdr, padding);
    if (out != NULL) {
        memset(out, 0, padding);
    }
}

void fcsl_cdr_u8(fcsl_cdr_t *cdr, uint8_t value)
{
    uint8_t *out = take(cdr, 1);
    if (out != NULL) {
        *out = value;
    }
}

void fcsl_cdr_u32(fcsl_cdr_t *cdr, uint32_t value)
{
    fcsl_cdr_align(cdr, 4);
    uint8_t *out = take(cdr, 4);
    if (out != NULL) {
        fcsl_put_u32(out, value);
    }
}

void fcsl_cdr_u64(fcsl_cdr_t *cdr, uint64_t value)
{
    fcsl_cdr_align(cdr, 8);
    uint8_t *out = take(cdr, 8);
    if (out != NULL) {
        fcsl_put_u64(out, value);
    }
}

void fcsl_cdr_string(fcsl_cdr_t *cdr, const char *text)
{
    const size_t size = strlen(text) + 1;
    if (size > UINT32_MAX) {
        cdr->at = SIZE_MAX;
        return;
    }
    fcsl_cdr_u32(cdr, (uint32_t)size);
    uint8_t *out = take(cdr, size);
    if (out != NULL) {
        memcpy(out, text, size);
    }
}

uint8_t *fcsl_cdr_reserve_bytes(fcsl_cdr_t *cdr, uint32_t size)
{
    fcsl_cdr_u32(cdr, size);
    return take(cdr, size);
}

void fcsl_cdr_time(fcsl_cdr_t *cdr, uint64_t time_ns)
{
    fcsl_cdr_u32(cdr, (uint32_t)(time_ns / 1000000000u));
    fcsl_cdr_u32(cdr, (uint32_t)(time_ns % 1000000000u));
}

void fcsl_cdr_header(fcsl_cdr_t *cdr, uint64_t time_ns)
{
    fcsl_cdr_time(cdr, time_ns);
    fcsl_cdr_string(cdr, "");
}

size_t fcsl_cdr_end(const fcsl_cdr_t *cdr)
{
    return cdr->at <= cdr->capacity ? cdr->at : 0;
}
