/* SPDX-License-Identifier: Apache-2.0
 *
 * SBUS: 0x0F, 22 bytes of channels, a byte of flags, and an end byte, which of SBUS2 says which telemetry slot follows. There is
 * no checksum; the UART's parity is the only one.
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
static const uint64_t PAUSE_NS = 2000000u;
static const float LOW_US = 1000.0f;
static const float HIGH_US = 2000.0f;

/* 0, or of SBUS2 0x04, 0x14, 0x24, 0x34. */
static int is_end(uint8_t byte)
{
    return byte == 0u || (byte & 0xCFu) == 0x04u;
}

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    if (bytes[0] != BEGINNING) {
        return -1;
    }
    if (size < BYTES) {
        return 0;
    }
    return (bytes[FLAGS] & UNUSED_FLAGS) == 0 && is_end(bytes[END]) ? BYTES : -1;
}

int rc_sbus_take(rc_sbus_t *sbus, uint8_t byte, uint64_t time_ns, rc_frame_t *frame)
{
    if (time_ns - sbus->last_ns >= PAUSE_NS) {
        byte_stream_break(&sbus->stream);
    }
    sbus->last_ns = time_ns;
    if (byte_stream_take(&sbus->stream, byte, judge) == 0u) {
        return 0;
    }
    const uint8_t flags = sbus->stream.bytes[FLAGS];
    rc_unpack(sbus->stream.bytes + 1, frame->pulse_us);
    frame->pulse_us[16] = flags & CHANNEL_17 ? HIGH_US : LOW_US;
    frame->pulse_us[17] = flags & CHANNEL_18 ? HIGH_US : LOW_US;
    frame->count = CHANNELS;
    frame->frame_lost = (flags & FRAME_LOST) != 0;
    frame->failsafe = (flags & FAILSAFE) != 0;
    return 1;
}
