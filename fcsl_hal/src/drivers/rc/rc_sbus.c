/* SPDX-License-Identifier: Apache-2.0
 *
 * SBUS: 0x0F, 22 bytes of channels, a byte of flags, and an end byte, which of SBUS2 says which telemetry slot follows. There is
 * no checksum; the UART's parity is the only one. The pauses between frames tell nothing either: an adapter with a latency timer
 * delivers the bytes in pieces of its own.
 *
 * So a frame is what follows a frame. At first, and after something else, bytes of the channels may look like a frame, and do so
 * again in the next one while no stick moves: there two frames must follow each other, and no others lie across them.
 */
#include "rc.h"

enum {
    BYTES = 25,
    BEGINNING = 0x0F,
    FLAGS = 23, /* their place */
    END = 24,
    CHANNEL_17 = 1,
    CHANNEL_18 = 2,
    FRAME_LOST = 4,
    FAILSAFE = 8,
    UNUSED_FLAGS = 0xF0,
    CHANNELS = 18
};
static const float LOW_US = 1000.0f;
static const float HIGH_US = 2000.0f;

/* 0, or of SBUS2 0x04, 0x14, 0x24, 0x34. */
static int is_end(uint8_t byte)
{
    return byte == 0u || (byte & 0xCFu) == 0x04u;
}

static int is_frame(const uint8_t *bytes)
{
    return bytes[0] == BEGINNING && (bytes[FLAGS] & UNUSED_FLAGS) == 0 && is_end(bytes[END]);
}

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    if (bytes[0] != BEGINNING) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    return size < BYTES ? 0 : is_frame(bytes) ? BYTES : -FCSL_DRIVER_NO_FRAMES;
}

/* Two frames, of which the second one counts. */
static int32_t judge_pair(const uint8_t *bytes, uint32_t size)
{
    const int32_t first = judge(bytes, size);
    if (first <= 0 || size < 2 * BYTES) {
        return first < 0 ? first : 0;
    }
    int others = 0;
    //@ loop unroll BYTES;
    for (uint32_t i = 1; i < BYTES; i++) {
        others += is_frame(bytes + i);
    }
    return is_frame(bytes + BYTES) && others == 0 ? 2 * BYTES : -FCSL_DRIVER_NO_FRAMES;
}

int rc_sbus_take(rc_sbus_t *sbus, uint8_t byte, rc_frame_t *frame)
{
    const uint64_t garbage = sbus->stream.garbage;
    const uint32_t size = byte_stream_take(&sbus->stream, byte, sbus->in_sync ? judge : judge_pair);
    if (size < BYTES) {
        sbus->in_sync = sbus->in_sync && sbus->stream.garbage == garbage;
        return 0;
    }
    sbus->stream.frames += size / BYTES - 1u; /* a pair is two */
    sbus->in_sync = 1;
    const uint8_t *bytes = sbus->stream.bytes + (size - BYTES);
    const uint8_t flags = bytes[FLAGS];
    rc_unpack(bytes + 1, frame->pulse_us);
    frame->pulse_us[16] = flags & CHANNEL_17 ? HIGH_US : LOW_US;
    frame->pulse_us[17] = flags & CHANNEL_18 ? HIGH_US : LOW_US;
    frame->count = CHANNELS;
    frame->frame_lost = (flags & FRAME_LOST) != 0;
    frame->failsafe = (flags & FAILSAFE) != 0 || rc_is_empty(bytes + 1);
    return 1;
}
