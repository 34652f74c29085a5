/* SPDX-License-Identifier: Apache-2.0
 *
 * Consistent Overhead Byte Stuffing: a block is a number n from 1 to 255 and the n - 1 bytes up to the next zero, which is left
 * out (or n = 255, after which no zero is meant).
 */
#include "fcsl/fcsl_cobs.h"

#include <string.h>

enum { BLOCK_MAX = 255 };

size_t fcsl_cobs_encode(const uint8_t *frame, size_t size, uint8_t bytes[FCSL_COBS_BYTES_MAX])
{
    size_t code_at = 0;
    size_t end = 1;
    for (size_t i = 0; i < size; i++) {
        if (end - code_at == BLOCK_MAX) {
            bytes[code_at] = BLOCK_MAX;
            code_at = end++;
        }
        bytes[end] = frame[i];
        if (frame[i] == 0) {
            bytes[code_at] = (uint8_t)(end - code_at);
            code_at = end;
        }
        end++;
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
    size_t at = 0;
    while (at < count && !decoder->refused) {
        if (decoder->left == 0) {
            if (decoder->zero && decoder->size < FCSL_LINK_FRAME_MAX) {
                decoder->frame[decoder->size++] = 0;
            } else if (decoder->zero) {
                decoder->refused = 1;
            }
            decoder->left = (uint8_t)(bytes[at] - 1u);
            decoder->zero = bytes[at] < BLOCK_MAX;
            at++;
        }
        const size_t here = count - at < decoder->left ? count - at : decoder->left;
        if (here > FCSL_LINK_FRAME_MAX - decoder->size) {
            decoder->refused = 1;
            return;
        }
        memcpy(decoder->frame + decoder->size, bytes + at, here);
        decoder->size += (uint32_t)here;
        decoder->left -= (uint8_t)here;
        at += here;
    }
}

size_t fcsl_cobs_decode(fcsl_cobs_decoder_t *decoder, const uint8_t *bytes, size_t count, size_t *size)
{
    const uint8_t *zero = memchr(bytes, 0, count);
    const size_t before = zero != NULL ? (size_t)(zero - bytes) : count;
    append(decoder, bytes, before);
    *size = zero != NULL ? finish(decoder) : 0;
    return zero != NULL ? before + 1u : before;
}
