/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_cobs.h: a stream of any bytes, in pieces. Input: the size of the pieces, then the stream. The frames are those of the same
 * stream byte by byte, and each of them encodes to bytes that give it again.
 */
#include "fcsl/fcsl_cobs.h"
#include "fuzz.h"

static fcsl_cobs_decoder_t pieces;
static fcsl_cobs_decoder_t single;

/* The frame that these bytes complete, found byte by byte; 0 if they complete none before the last one. */
static size_t byte_by_byte(const uint8_t *bytes, size_t count)
{
    size_t size = 0;
    for (size_t i = 0; i < count; i++) {
        FUZZ_CHECK(size == 0);
        FUZZ_CHECK(fcsl_cobs_decode(&single, bytes + i, 1, &size) == 1);
    }
    return size;
}

static void check_frame(const uint8_t *frame, size_t size)
{
    static fcsl_cobs_decoder_t again;
    uint8_t bytes[FCSL_COBS_BYTES_MAX];
    size_t found = 0;
    const size_t count = fcsl_cobs_encode(frame, size, bytes);
    FUZZ_CHECK(count <= FCSL_COBS_BYTES_MAX && memchr(bytes, 0, count) == bytes + count - 1);
    FUZZ_CHECK(fcsl_cobs_decode(&again, bytes, count, &found) == count);
    FUZZ_CHECK(found == size && memcmp(again.frame, frame, size) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const size_t piece = 1 + (size_t)take_number(&bytes, 1);
    memset(&pieces, 0, sizeof pieces);
    memset(&single, 0, sizeof single);
    while (bytes.left > 0) {
        size_t count = piece;
        uint8_t *copy = take_copy(&bytes, &count);
        for (size_t at = 0; at < count;) {
            size_t found = 0;
            const size_t taken = fcsl_cobs_decode(&pieces, copy + at, count - at, &found);
            FUZZ_CHECK(taken >= 1 && taken <= count - at && found <= FCSL_LINK_FRAME_MAX);
            FUZZ_CHECK(byte_by_byte(copy + at, taken) == found && pieces.garbage == single.garbage);
            if (found > 0) {
                FUZZ_CHECK(memcmp(pieces.frame, single.frame, found) == 0);
                check_frame(pieces.frame, found);
            }
            at += taken;
        }
        free(copy);
    }
    return 0;
}
