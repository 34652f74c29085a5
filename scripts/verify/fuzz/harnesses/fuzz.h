/* SPDX-License-Identifier: Apache-2.0
 *
 * What the fuzz harnesses share. A harness holds what a parser promises with FUZZ_CHECK; memory and arithmetic are the
 * sanitizers' business. scripts/verify/fuzz/main.py builds and runs them.
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FUZZ_CHECK(condition)                                                                                          \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);                       \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

/* The input, taken from its front. */
typedef struct {
    const uint8_t *at;
    size_t left;
} bytes_t;

/* The next number of `size` bytes (at most 8), little-endian; zeros behind the end. */
static inline uint64_t take_number(bytes_t *bytes, size_t size)
{
    uint64_t value = 0;
    for (size_t i = 0; i < size && bytes->left > 0; i++, bytes->at++, bytes->left--) {
        value |= (uint64_t)*bytes->at << (8u * i);
    }
    return value;
}

/* A copy of the next `size` bytes, or of what is left, in memory of exactly that size, so that one byte too many is seen. */
static inline uint8_t *take_copy(bytes_t *bytes, size_t *size)
{
    *size = *size < bytes->left ? *size : bytes->left;
    uint8_t *copy = malloc(*size);
    FUZZ_CHECK(copy != NULL || *size == 0);
    if (*size > 0) {
        memcpy(copy, bytes->at, *size);
    }
    bytes->at += *size;
    bytes->left -= *size;
    return copy;
}

/* The rest as text, ending in a zero. */
static inline char *take_text(bytes_t *bytes)
{
    char *text = malloc(bytes->left + 1u);
    FUZZ_CHECK(text != NULL);
    memcpy(text, bytes->at, bytes->left);
    text[bytes->left] = '\0';
    bytes->left = 0;
    return text;
}

/* Overwrites single numbers of a table: `count` patches of offset (2 bytes, modulo the table's size) and value. Words are of
 * 4 bytes, mostly small, so that patched tables still hold together now and then. */
static inline void patch_words(bytes_t *bytes, void *table, size_t size, uint32_t count)
{
    for (uint32_t i = 0; i < count && size >= 4u; i++) {
        const size_t at = (size_t)take_number(bytes, 2) % (size / 4u) * 4u;
        const int wide = (take_number(bytes, 1) & 1u) != 0;
        const uint32_t value = wide ? (uint32_t)take_number(bytes, 4) : (uint32_t)(int8_t)take_number(bytes, 1);
        memcpy((uint8_t *)table + at, &value, sizeof value);
    }
}

#endif /* FUZZ_H */
