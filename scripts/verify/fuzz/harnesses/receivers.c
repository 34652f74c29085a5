/* SPDX-License-Identifier: Apache-2.0
 *
 * gnss.h, rc.h, tfmini.h: streams of receivers. Input: which protocol, then the stream; or, since chance finds no checksums, the bodies of
 * messages, which this puts into frames. Every byte is part of a frame, garbage or still waiting, and what comes out can be.
 */
#include <math.h>

#include "fuzz.h"
#include "gnss.h"
#include "rc.h"
#include "tfmini.h"

enum { PVT_BYTES = 92, FIELDS_BYTES = 92 };

static gnss_ubx_t ubx;
static gnss_nmea_t nmea;
static rc_sbus_t sbus;
static rc_crsf_t crsf;
static tfmini_t tfmini;
static uint64_t fed;
static uint64_t framed; /* bytes of frames */

static void count(const byte_stream_t *stream)
{
    fed++;
    framed += stream->taken;
    FUZZ_CHECK(stream->size <= BYTE_STREAM_MAX && stream->taken <= stream->size);
    FUZZ_CHECK(framed + stream->garbage + stream->size - stream->taken == fed);
}

static void check_fix(const gnss_fix_t *fix)
{
    FUZZ_CHECK(fix->kind == GNSS_NO_FIX || fix->kind == GNSS_2D || fix->kind == GNSS_3D);
    FUZZ_CHECK(fix->satellites < 256);
}

static void check_rc(const rc_frame_t *frame)
{
    FUZZ_CHECK(frame->count == 16 || frame->count == 18);
    for (uint32_t i = 0; i < frame->count; i++) {
        FUZZ_CHECK(frame->pulse_us[i] >= 880.0f && frame->pulse_us[i] <= 2160.0f);
    }
}

static void feed(uint32_t protocol, uint8_t byte)
{
    gnss_fix_t fix;
    rc_frame_t frame;
    rc_link_t link;
    tfmini_reading_t reading;
    if (protocol == 0u) {
        if (gnss_ubx_take(&ubx, byte, &fix)) {
            check_fix(&fix);
        }
        count(&ubx.stream);
    } else if (protocol == 1u) {
        if (gnss_nmea_take(&nmea, byte, &fix)) {
            check_fix(&fix);
            FUZZ_CHECK(isnan(fix.latitude_deg) || fabs(fix.latitude_deg) <= 90.0);
            FUZZ_CHECK(isnan(fix.longitude_deg) || fabs(fix.longitude_deg) <= 180.0);
        }
        count(&nmea.stream);
    } else if (protocol == 2u) {
        if (rc_sbus_take(&sbus, byte, &frame)) {
            check_rc(&frame);
        }
        count(&sbus.stream);
    } else if (protocol == 3u) {
        if (rc_crsf_take(&crsf, byte, &frame, &link) == RC_CRSF_CHANNELS) {
            check_rc(&frame);
        }
        count(&crsf.stream);
    } else {
        if (tfmini_take(&tfmini, byte, &reading)) {
            FUZZ_CHECK(reading.distance_cm > 0u || !reading.is_reliable);
        }
        count(&tfmini.stream);
    }
}

static void feed_ubx_message(const uint8_t *body, size_t size)
{
    const uint8_t head[] = {0xB5, 0x62, 0x01, 0x07, (uint8_t)size, (uint8_t)(size >> 8)};
    uint8_t a = 0;
    uint8_t b = 0;
    for (size_t i = 0; i < sizeof head + size; i++) {
        const uint8_t byte = i < sizeof head ? head[i] : body[i - sizeof head];
        a = (uint8_t)(a + (i < 2 ? 0 : byte));
        b = (uint8_t)(b + (i < 2 ? 0 : a));
        feed(0, byte);
    }
    feed(0, a);
    feed(0, b);
}

/* A third of all values are commas, the others are characters that fields have. */
static void feed_sentence(const uint8_t *body, size_t size, int is_rmc)
{
    static const char CHARACTERS[] = ",,,,,,,,,,0123456789.-NSEWA1";
    static const char HEX[] = "0123456789ABCDEF";
    const char *name = is_rmc ? "GPRMC,123519" : "GPGGA,123519";
    uint8_t sum = 0;
    feed(1, '$');
    for (const char *c = name; *c != '\0'; c++) {
        sum ^= (uint8_t)*c;
        feed(1, (uint8_t)*c);
    }
    for (size_t i = 0; i < size; i++) {
        const uint8_t c = (uint8_t)CHARACTERS[body[i] % (sizeof CHARACTERS - 1)];
        sum ^= c;
        feed(1, c);
    }
    feed(1, '*');
    feed(1, (uint8_t)HEX[sum >> 4]);
    feed(1, (uint8_t)HEX[sum & 15]);
    feed(1, '\r');
    feed(1, '\n');
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    const uint32_t what = (uint32_t)take_number(&bytes, 1) % 8u;
    const int is_raw = what < 4u || what == 7u;
    memset(&ubx, 0, sizeof ubx);
    memset(&nmea, 0, sizeof nmea);
    memset(&sbus, 0, sizeof sbus);
    memset(&crsf, 0, sizeof crsf);
    memset(&tfmini, 0, sizeof tfmini);
    fed = 0;
    framed = 0;
    while (bytes.left > 0) {
        size_t length = is_raw ? bytes.left : what == 4u ? PVT_BYTES : FIELDS_BYTES;
        uint8_t *body = take_copy(&bytes, &length);
        for (size_t i = 0; i < length && is_raw; i++) {
            feed(what == 7u ? 4u : what, body[i]);
        }
        if (what == 4u) {
            feed_ubx_message(body, length);
        } else if (!is_raw) {
            feed_sentence(body, length, what == 6u);
        }
        free(body);
    }
    return 0;
}
