/* SPDX-License-Identifier: Apache-2.0
 *
 * 0x59 0x59, distance, strength and temperature of two bytes each, the lower one first, and the low byte of the sum of all of them.
 */
#include "tfmini.h"

enum {
    FRAME_BYTES = 9,
    HEAD_BYTES = 2,
    HEAD = 0x59,
    DISTANCE = 2, /* their places */
    STRENGTH = 4,
    TEMPERATURE = 6,
    SUM = 8,
    STRENGTH_MIN = 100, /* a weaker echo is unreliable */
    STRENGTH_OVEREXPOSED = 65535,
    DISTANCE_ERRORS = 65532 /* from here on: -1, -2 and -4 of the TFmini-S for no echo, saturation and ambient light */
};

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    if (bytes[0] != HEAD || (size >= HEAD_BYTES && bytes[1] != HEAD)) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    if (size < FRAME_BYTES) {
        return 0;
    }
    uint32_t sum = 0;
    for (uint32_t i = 0; i < SUM; i++) {
        sum += bytes[i];
    }
    return (sum & 0xFFu) == bytes[SUM] ? FRAME_BYTES : -FCSL_DRIVER_NO_FRAMES;
}

static uint32_t word_at(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8;
}

int tfmini_take(tfmini_t *tfmini, uint8_t byte, tfmini_reading_t *reading)
{
    const uint8_t *bytes = tfmini->stream.bytes;
    if (byte_stream_take(&tfmini->stream, byte, judge) == 0u) {
        return 0;
    }
    reading->distance_cm = word_at(bytes + DISTANCE);
    reading->strength = word_at(bytes + STRENGTH);
    reading->temperature_degc = word_at(bytes + TEMPERATURE) / 8.0 - 256.0;
    /* The TFmini Plus sends a distance of 0 where it has none. */
    reading->is_reliable = reading->strength >= STRENGTH_MIN && reading->strength < STRENGTH_OVEREXPOSED &&
                           reading->distance_cm > 0u && reading->distance_cm < DISTANCE_ERRORS;
    return 1;
}
