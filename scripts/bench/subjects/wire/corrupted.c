/* SPDX-License-Identifier: Apache-2.0
 *
 * Corrupted frames, and which of them are accepted.
 */
#include "corrupted.h"

#include "values.h"

#include <fcsl/fcsl_cobs.h>

enum { BURST = 8, PATTERNS = 256 };

/* The frames of many messages, since one is as good as another. */
typedef struct {
    uint8_t bytes[PATTERNS][MESSAGE_MAX];
    size_t size[PATTERNS];
} frames_t;

static void make(frames_t *frames, const format_t *format)
{
    format->reset();
    for (uint64_t i = 0; i < PATTERNS; i++) {
        const values_t values = values_of(FIRST_TICK + i);
        frames->size[i] = format->encode(SENSORS, &values, frames->bytes[i]);
    }
}

/* Link frames without the COBS around them. */
static void strip(frames_t *frames)
{
    for (int i = 0; i < PATTERNS; i++) {
        fcsl_cobs_decoder_t decoder = {.size = 0};
        size_t size = 0;
        (void)fcsl_cobs_decode(&decoder, frames->bytes[i], frames->size[i], &size);
        memcpy(frames->bytes[i], decoder.frame, size);
        frames->size[i] = size;
    }
}

/* A copy of a frame with a burst of random bits somewhere in its bytes from `first` on. */
static size_t corrupt(const frames_t *frames, size_t first, uint64_t *state, uint8_t bytes[MESSAGE_MAX])
{
    const uint64_t which = next_random(state) % PATTERNS;
    const size_t size = frames->size[which];
    const size_t at = first + next_random(state) % (size - first - BURST + 1u);
    const uint64_t noise = next_random(state); /* never 0: some bit flips */
    memcpy(bytes, frames->bytes[which], size);
    for (int i = 0; i < BURST; i++) {
        bytes[at + (size_t)i] ^= (uint8_t)(noise >> 8 * i);
    }
    return size;
}

/* Of whole messages and frames: how many the format accepts. */
static int is_accepted(const format_t *format, const uint8_t *bytes, size_t size)
{
    values_t values;
    int accepted = 0;
    (void)format->decode(SENSORS, bytes, size, &values, &accepted);
    return accepted;
}

corrupted_t under_corruption(long frames)
{
    static frames_t message;
    static frames_t link;
    static frames_t mavlink;
    uint64_t state = 1;
    corrupted_t found = {0};
    make(&message, &FCSL_MESSAGE);
    make(&link, &FCSL_SERIAL);
    strip(&link);
    make(&mavlink, &MAVLINK_OWN);
    for (long i = 0; i < frames; i++) {
        uint8_t bytes[MESSAGE_MAX];
        size_t size = corrupt(&message, 0, &state, bytes);
        found.message += is_accepted(&FCSL_MESSAGE, bytes, size);
        size = corrupt(&link, 0, &state, bytes);
        if (fcsl_crc16(0xFFFFu, bytes, size - 2u) == (uint16_t)(bytes[size - 2u] | bytes[size - 1u] << 8)) {
            found.link++;
            found.both += is_accepted(&FCSL_MESSAGE, bytes + 6, size - 8u);
        }
        MAVLINK_OWN.reset();
        size = corrupt(&mavlink, 10, &state,
                       bytes); /* behind the header: a parser that has lost the size waits for more */
        found.mavlink += is_accepted(&MAVLINK_OWN, bytes, size);
    }
    return found;
}
