/* SPDX-License-Identifier: Apache-2.0
 *
 * Receivers of remote controls: frames that others published, and streams that are damaged.
 */
#include <string.h>

#include "fcsl_check.h"
#include "drivers/rc/rc.h"

enum { SBUS_BYTES = 25, CRSF_BYTES = 26 };

/* The example of the crate sbus-protocol, and the channels that it tells. */
static const uint8_t SBUS[SBUS_BYTES] = {0x0F, 0xE0, 0x03, 0x1F, 0x58, 0xC0, 0x07, 0x16, 0xB0, 0x80, 0x05, 0x2C, 0x60,
                                         0x01, 0x0B, 0xF8, 0xC0, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x03, 0x00};
static const int SBUS_CHANNELS[] = {992, 992, 352, 992, 352, 352, 352, 352, 352, 352, 992, 992, 0, 0, 0, 0};

/* Captured by Betaflight's unit tests, and what its rx_crsf makes of them. */
static const uint8_t CRSF[2][CRSF_BYTES] = {
    {0x00, 0x18, 0x16, 0xBD, 0x08, 0x9F, 0xF4, 0xAE, 0xF7, 0xBD, 0xEF, 0x7D, 0xEF,
     0xFB, 0xAD, 0xFD, 0x45, 0x2B, 0x5A, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x6C},
    {0x00, 0x18, 0x16, 0xBD, 0x08, 0x9F, 0xF4, 0xAA, 0xF7, 0xBD, 0xEF, 0x7D, 0xEF,
     0xFB, 0xAD, 0xFD, 0x45, 0x2B, 0x5A, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x94}};
static const int CRSF_CHANNELS[] = {189, 993, 978, 983, 991, 991, 991, 2015, 1453, 191, 173, 173, 0, 0, 0, 0};

/* ---- SBUS --------------------------------------------------------------------------------------------------------------- */

/* Frames that come of these bytes; the last one is *frame. */
static int feed_sbus(rc_sbus_t *sbus, const uint8_t *bytes, uint32_t size, rc_frame_t *frame)
{
    int frames = 0;
    for (uint32_t i = 0; i < size; i++) {
        frames += rc_sbus_take(sbus, bytes[i], frame);
    }
    return frames;
}

static int has_channels(const rc_frame_t *frame, const int *steps)
{
    for (uint32_t i = 0; i < RC_PACKED_CHANNELS; i++) {
        if (frame->pulse_us[i] != (float)(1500.0 + (steps[i] - 992) * 0.625)) {
            return 0;
        }
    }
    return 1;
}

static void check_published_sbus(void)
{
    rc_sbus_t sbus = {0};
    rc_frame_t frame;
    CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 0);
    CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1);
    CHECK(has_channels(&frame, SBUS_CHANNELS));
    CHECK(frame.count == 18 && frame.pulse_us[16] == 2000.0f && frame.pulse_us[17] == 2000.0f);
    CHECK(!frame.frame_lost && !frame.failsafe && sbus.stream.garbage == 0);
}

static void check_sbus_flags(void)
{
    static const struct {
        uint8_t flags;
        uint8_t end;
        int taken;
        int frame_lost;
        int failsafe;
    } CASES[] = {{0x04, 0x00, 1, 1, 0}, {0x08, 0x00, 1, 0, 1}, {0x0C, 0x04, 1, 1, 1}, {0x00, 0x34, 1, 0, 0},
                 {0x00, 0x24, 1, 0, 0}, {0x10, 0x00, 0, 0, 0}, {0x00, 0x01, 0, 0, 0}, {0x00, 0x44, 0, 0, 0}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        rc_sbus_t sbus = {0};
        rc_frame_t frame;
        uint8_t bytes[SBUS_BYTES];
        CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) + feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1);
        memcpy(bytes, SBUS, sizeof bytes);
        bytes[23] = CASES[i].flags;
        bytes[24] = CASES[i].end;
        CHECK(feed_sbus(&sbus, bytes, sizeof bytes, &frame) == CASES[i].taken);
        CHECK(!CASES[i].taken || (frame.frame_lost == CASES[i].frame_lost && frame.failsafe == CASES[i].failsafe));
    }
}

/* A byte is lost in a frame, or one comes in addition: the frame behind it tells where they begin, and the next one is taken. */
static void check_sbus_loses_bytes(void)
{
    rc_sbus_t sbus = {0};
    rc_frame_t frame;
    CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) + feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1);
    for (uint32_t at = 0; at < 2u * SBUS_BYTES - 1u; at++) {
        const int is_more = at >= SBUS_BYTES;
        const uint32_t place = is_more ? at - SBUS_BYTES + 1u : at;
        uint8_t bytes[SBUS_BYTES + 1] = {0};
        memcpy(bytes, SBUS, place);
        bytes[place] = 0x55;
        memcpy(bytes + place + is_more, SBUS + place + !is_more, SBUS_BYTES - place - !is_more);
        CHECK(feed_sbus(&sbus, bytes, is_more ? SBUS_BYTES + 1u : SBUS_BYTES - 1u, &frame) == 0);
        CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 0);
        CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1 && has_channels(&frame, SBUS_CHANNELS));
        CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1 && has_channels(&frame, SBUS_CHANNELS));
    }
}

/* The receiver was heard from the middle of a frame on, wherever that is. */
static void check_sbus_begins_anywhere(void)
{
    for (uint32_t first = 1; first < SBUS_BYTES; first++) {
        rc_sbus_t sbus = {0};
        rc_frame_t frame;
        CHECK(feed_sbus(&sbus, SBUS + first, SBUS_BYTES - first, &frame) == 0);
        int frames = 0;
        for (int i = 0; i < 4; i++) {
            frames += feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame);
            CHECK(frames == 0 || has_channels(&frame, SBUS_CHANNELS));
        }
        CHECK(frames >= 2);
    }
}

/* Channels that look like a frame across two of them, at sticks that do not move: neither is taken until one does. */
static void check_sbus_that_looks_like_two(void)
{
    rc_sbus_t sbus = {0};
    rc_frame_t frame;
    uint8_t twin[SBUS_BYTES] = {0x0F};
    memcpy(twin + 10, (const uint8_t[]){0x00, 0x04, 0x0F}, 3);
    CHECK(feed_sbus(&sbus, twin + 12, SBUS_BYTES - 12, &frame) == 0);
    for (int i = 0; i < 20; i++) {
        CHECK(feed_sbus(&sbus, twin, SBUS_BYTES, &frame) == 0);
    }
    int frames = 0;
    for (int i = 0; i < 4; i++) {
        frames += feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame);
        CHECK(frames == 0 || has_channels(&frame, SBUS_CHANNELS));
    }
    CHECK(frames >= 2);
}

/* ---- CRSF --------------------------------------------------------------------------------------------------------------- */

static int feed_crsf(rc_crsf_t *crsf, const uint8_t *bytes, uint32_t size, rc_frame_t *frame, rc_link_t *link)
{
    int found = 0;
    for (uint32_t i = 0; i < size; i++) {
        found += rc_crsf_take(crsf, bytes[i], frame, link) != RC_CRSF_NOTHING;
    }
    return found;
}

static void check_published_crsf(void)
{
    rc_crsf_t crsf = {0};
    rc_frame_t frame;
    rc_link_t link;
    CHECK(feed_crsf(&crsf, CRSF[0], CRSF_BYTES, &frame, &link) == 1);
    CHECK(frame.count == 16 && has_channels(&frame, CRSF_CHANNELS) && !frame.failsafe);
    CHECK(feed_crsf(&crsf, CRSF[1], CRSF_BYTES, &frame, &link) == 1);
    CHECK(frame.pulse_us[3] == 1500.0f + (981.0f - 992.0f) * 0.625f);
    CHECK(crsf.stream.garbage == 0 && crsf.stream.why == FCSL_DRIVER_NOT_TOLD);
}

/* Of two antennas the second hears better: -45 dBm; quality 100 %, SNR -10 dB. */
static void check_crsf_link(void)
{
    static const uint8_t LINK[] = {0xC8, 0x0C, 0x14, 0x32, 0x2D, 0x64, 0xF6, 0x00, 0x02, 0x03, 0x40, 0x62, 0x0C, 0x8A};
    static const uint8_t BATTERY[] = {0xC8, 0x03, 0x08, 0x00, 0x00};
    rc_crsf_t crsf = {0};
    rc_frame_t frame;
    rc_link_t link = {0};
    CHECK(feed_crsf(&crsf, LINK, sizeof LINK, &frame, &link) == 1);
    CHECK(link.rssi_dbm == -45 && link.quality_percent == 100 && link.snr_db == -10);
    CHECK(feed_crsf(&crsf, BATTERY, sizeof BATTERY, &frame, &link) == 0);
}

/* A bit of each byte is turned, one after the other: no wrong frame comes, and the next good one does. */
static void check_damaged_crsf(void)
{
    rc_crsf_t crsf = {0};
    rc_frame_t frame;
    rc_link_t link;
    for (uint32_t bit = 0; bit < 8u * CRSF_BYTES; bit++) {
        uint8_t bytes[CRSF_BYTES];
        memcpy(bytes, CRSF[0], sizeof bytes);
        bytes[bit / 8u] ^= (uint8_t)(1u << bit % 8u);
        const int came = feed_crsf(&crsf, bytes, CRSF_BYTES, &frame, &link);
        CHECK(came == 0 || (bit < 8u && has_channels(&frame, CRSF_CHANNELS))); /* another address is as good */
        int later = 0;
        for (int i = 0; i < 4; i++) { /* a longer length swallows the frames behind it until it proves wrong */
            later += feed_crsf(&crsf, CRSF[0], CRSF_BYTES, &frame, &link);
        }
        CHECK(later >= 2 && has_channels(&frame, CRSF_CHANNELS));
    }
}

/* All channels at zero, which FrSky's receivers send without a flag, is failsafe; a single other bit is none. */
static void check_empty_frames(void)
{
    static const uint8_t NO_CRSF[CRSF_BYTES] = {[0] = 0xC8, [1] = 0x18, [2] = 0x16, [CRSF_BYTES - 1] = 0xEF};
    rc_sbus_t sbus = {0};
    rc_crsf_t crsf = {0};
    rc_frame_t frame;
    rc_link_t link;
    uint8_t bytes[SBUS_BYTES] = {0x0F};
    CHECK(feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) + feed_sbus(&sbus, SBUS, SBUS_BYTES, &frame) == 1);
    CHECK(feed_sbus(&sbus, bytes, sizeof bytes, &frame) == 1 && frame.failsafe);
    bytes[9] = 0x10;
    CHECK(feed_sbus(&sbus, bytes, sizeof bytes, &frame) == 1 && !frame.failsafe);
    CHECK(feed_crsf(&crsf, NO_CRSF, CRSF_BYTES, &frame, &link) == 1 && frame.failsafe);
    CHECK(feed_crsf(&crsf, CRSF[0], CRSF_BYTES, &frame, &link) == 1 && !frame.failsafe);
}

int main(void)
{
    check_published_sbus();
    check_sbus_flags();
    check_empty_frames();
    check_sbus_loses_bytes();
    check_sbus_begins_anywhere();
    check_sbus_that_looks_like_two();
    check_published_crsf();
    check_crsf_link();
    check_damaged_crsf();
    return 0;
}
