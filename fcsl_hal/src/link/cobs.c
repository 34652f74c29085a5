/* SPDX-License-Identifier: Apache-2.0
 *
 * Consistent Overhead Byte Stuffing: a block is a number n from 1 to 255 and the n - 1 bytes up to the next zero, which is left
 * out (or n = 255, after which no zero is meant).
 */
#include "fcsl/fcsl_cobs.h"

#include <string.h>

enum { BLOCK_MAX = 255, WORD = 8 };

/* Whether one of eight bytes is zero ("Hacker's Delight", 6-1). */
static int has_zero(const uint8_t *bytes)
{
    uint64_t word = 0;
    memcpy(&word, bytes, sizeof word);
    return ((word - UINT64_C(0x0101010101010101)) & ~word & UINT64_C(0x8080808080808080)) != 0;
}

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

size_t fcsl_cobs_encode(const uint8_t *frame, size_t size, uint8_t bytes[FCSL_COBS_BYTES_MAX])
{
    size_t code_at = 0;
    size_t end = 1;
    size_t count = 0;
    /* For scripts/verify/codec, which follows each round: */
    //@ loop unroll FCSL_LINK_FRAME_MAX;
    for (size_t i = 0; i < size; i += count) {
        if (end - code_at == BLOCK_MAX) {
            bytes[code_at] = BLOCK_MAX;
            code_at = end++;
        }
        count = min_size(min_size(size - i, WORD), BLOCK_MAX - (end - code_at));
        if (count == WORD && !has_zero(frame + i)) {
            memcpy(bytes + end, frame + i, WORD);
            end += WORD;
            continue;
        }
        for (size_t j = 0; j < count; j++, end++) {
            bytes[end] = frame[i + j];
            if (frame[i + j] == 0) {
                bytes[code_at] = (uint8_t)(end - code_at);
                code_at = end;
            }
        }
    }
    bytes[code_at] = (uint8_t)(end - code_at);
    bytes[end++] = 0;
    return end;
}

/* A zero: the end of a frame, or of something else. */
static size_t finish(fcsl_cobs_decoder_t *decoder)
{
    const size_t size = !decoder->refused && decoder->left == 0 ? decoder->size : 0;
    decoder->garbage += size == 0 && (decoder->size > 0 || decoder->left > 0 || decoder->refused);
    decoder->size = 0;
    decoder->left = 0;
    decoder->zero = 0;
    decoder->refused = 0;
    return size;
}

/* Takes bytes that are not zero. */
static void append(fcsl_cobs_decoder_t *decoder, const uint8_t *bytes, size_t count)
{
    uint32_t size = decoder->size;
    size_t at = 0;
    while (at < count && !decoder->refused) {
        if (decoder->left == 0) {
            decoder->refused = decoder->zero && size == FCSL_LINK_FRAME_MAX;
            if (decoder->zero && size < FCSL_LINK_FRAME_MAX) {
                decoder->frame[size++] = 0;
            }
            decoder->left = (uint8_t)(bytes[at] - 1u);
            decoder->zero = bytes[at] < BLOCK_MAX;
            at++;
        }
        const size_t begin = at;
        size_t end = at + decoder->left;
        if (end > count) {
            end = count;
        }
        for (; at + WORD <= end && size + WORD <= FCSL_LINK_FRAME_MAX; at += WORD) {
            memcpy(decoder->frame + size, bytes + at, WORD);
            size += WORD;
        }
        for (; at < end && size < FCSL_LINK_FRAME_MAX; at++) {
            decoder->frame[size++] = bytes[at];
        }
        decoder->refused |= at < end;
        decoder->left = (uint8_t)(decoder->left - (at - begin));
    }
    decoder->size = size;
}

size_t fcsl_cobs_decode(fcsl_cobs_decoder_t *decoder, const uint8_t *bytes, size_t count, size_t *size)
{
    const uint8_t *zero = memchr(bytes, 0, count);
    *size = 0;
    if (zero == NULL) {
        append(decoder, bytes, count);
        return count;
    }
    const size_t before = (size_t)(zero - bytes);
    append(decoder, bytes, before);
    *size = finish(decoder);
    return before + 1u;
}
