/* SPDX-License-Identifier: Apache-2.0
 *
 * Receivers of satellite navigation: messages of real receivers, of u-blox's protocol specification, and damaged ones.
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "fcsl_check.h"
#include "drivers/gnss/gnss.h"

enum { LINE_BYTES = 256, PVT_BYTES = 92, PVT_FRAME = PVT_BYTES + 8 };

/* ---- UBX ---------------------------------------------------------------------------------------------------------------- */

/* Of a receiver that had just been switched on, in Karlsruhe: it computes a position that it does not vouch for. */
static const uint8_t PVT[PVT_BYTES] = {
    0x60, 0xA7, 0x43, 0x0F, 0xE5, 0x07, 0x02, 0x17, 0x17, 0x07, 0x36, 0x37, 0x32, 0x00, 0x00, 0x00, 0x8C, 0x84, 0xFD,
    0xFF, 0x03, 0x00, 0x0A, 0x04, 0x86, 0x16, 0x00, 0x05, 0xB7, 0x68, 0x39, 0x1D, 0xCB, 0x53, 0x02, 0x00, 0x73, 0x9A,
    0x01, 0x00, 0xA9, 0x7B, 0x00, 0x00, 0x04, 0x4E, 0x00, 0x00, 0xCC, 0xFC, 0xFF, 0xFF, 0xF8, 0xF6, 0xFF, 0xFF, 0xAF,
    0xFE, 0xFF, 0xFF, 0x95, 0x09, 0x00, 0x00, 0xA2, 0xB5, 0xB9, 0x01, 0x8F, 0x0C, 0x00, 0x00, 0x9C, 0x2D, 0x44, 0x00,
    0x1E, 0x0B, 0x00, 0x00, 0xE0, 0x4A, 0x23, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};
/* A request for NAV-PVT, with the checksum that u-blox gives. */
static const uint8_t POLL[] = {0xB5, 0x62, 0x01, 0x07, 0x00, 0x00, 0x08, 0x19};

/* A frame of the first `bytes` of a payload. Returns its size. */
static uint32_t frame_of(const uint8_t *payload, uint32_t bytes, uint8_t frame[PVT_FRAME])
{
    const uint8_t head[] = {0xB5, 0x62, 0x01, 0x07, (uint8_t)bytes, 0};
    const uint32_t end = (uint32_t)sizeof head + bytes;
    uint8_t a = 0;
    uint8_t b = 0;
    memcpy(frame, head, sizeof head);
    memcpy(frame + sizeof head, payload, bytes);
    for (uint32_t i = 2; i < end; i++) {
        a = (uint8_t)(a + frame[i]);
        b = (uint8_t)(b + a);
    }
    frame[end] = a;
    frame[end + 1u] = b;
    return end + 2u;
}

static void frame_pvt(const uint8_t payload[PVT_BYTES], uint8_t frame[PVT_FRAME])
{
    CHECK(frame_of(payload, PVT_BYTES, frame) == PVT_FRAME);
}

static int feed_ubx(gnss_ubx_t *ubx, const uint8_t *bytes, uint32_t size, gnss_fix_t *fix)
{
    int found = 0;
    for (uint32_t i = 0; i < size; i++) {
        found += gnss_ubx_take(ubx, bytes[i], fix);
    }
    return found;
}

static void check_pvt(void)
{
    static gnss_ubx_t ubx;
    gnss_fix_t fix;
    uint8_t payload[PVT_BYTES];
    uint8_t frame[PVT_FRAME];
    frame_pvt(PVT, frame);
    CHECK(frame[PVT_FRAME - 2] == 0x80 && frame[PVT_FRAME - 1] == 0xB6);
    CHECK(feed_ubx(&ubx, POLL, sizeof POLL, &fix) == 0 && ubx.stream.garbage == 0);
    CHECK(feed_ubx(&ubx, frame, sizeof frame, &fix) == 1 && fix.kind == GNSS_NO_FIX);
    CHECK(fix.has_utc && fix.utc_ns == INT64_C(1614121674) * 1000000000 - 162676);
    CHECK(fix.satellites == 4 && fix.longitude_deg == 8.3891846 && fix.latitude_deg == 49.0301623);
    CHECK(fix.height_m == 152.523 && fix.altitude_m == 105.075);
    CHECK(fix.velocity_ned_mps[0] == -0.820f && fix.velocity_ned_mps[1] == -2.312f);
    CHECK(fix.velocity_ned_mps[2] == -0.337f && fix.ground_speed_mps == 2.453f && fix.course_deg == 289.47874f);
    CHECK(fix.horizontal_m == 31.657f && fix.vertical_m == 19.972f && fix.speed_mps == 3.215f);
    CHECK(fix.dilution == 28.46f);
    const uint32_t size = frame_of(PVT, 84, frame); /* u-blox 7 */
    CHECK(feed_ubx(&ubx, frame, size, &fix) == 1 && fix.dilution == 28.46f);
    CHECK(feed_ubx(&ubx, frame, frame_of(PVT, 83, frame), &fix) == 0 && ubx.stream.why == FCSL_DRIVER_REFUSED);
    memcpy(payload, PVT, sizeof payload);
    payload[5] = 0xFF; /* of the year */
    frame_pvt(payload, frame);
    CHECK(feed_ubx(&ubx, frame, sizeof frame, &fix) == 1 && !fix.has_utc);
    payload[21] = 1;
    payload[11] = 0;
    for (uint8_t type = 0; type < 6u; type++) {
        static const gnss_fix_kind_t KINDS[] = {GNSS_NO_FIX, GNSS_NO_FIX, GNSS_2D, GNSS_3D, GNSS_3D, GNSS_NO_FIX};
        payload[20] = type;
        frame_pvt(payload, frame);
        CHECK(feed_ubx(&ubx, frame, sizeof frame, &fix) == 1 && fix.kind == KINDS[type] && !fix.has_utc);
    }
}

/* A bit of each byte is turned: no fix comes of it, and the next frames come. */
static void check_damaged_ubx(void)
{
    static gnss_ubx_t ubx;
    gnss_fix_t fix;
    uint8_t good[PVT_FRAME];
    frame_pvt(PVT, good);
    for (uint32_t bit = 0; bit < 8u * PVT_FRAME; bit++) {
        uint8_t bad[PVT_FRAME];
        memcpy(bad, good, sizeof bad);
        bad[bit / 8u] ^= (uint8_t)(1u << bit % 8u);
        CHECK(feed_ubx(&ubx, bad, sizeof bad, &fix) == 0);
        int later = 0;
        for (int i = 0; i < 12; i++) { /* a longer length swallows as much as there is room for */
            later += feed_ubx(&ubx, good, sizeof good, &fix);
        }
        CHECK(later >= 1);
    }
}

/* ---- NMEA --------------------------------------------------------------------------------------------------------------- */

/* With the sum of the sentence and the end of the line. */
static int feed_nmea(gnss_nmea_t *nmea, const char *body, gnss_fix_t *fix)
{
    char line[LINE_BYTES];
    unsigned sum = 0;
    for (const char *c = body; *c != '\0'; c++) {
        sum ^= (unsigned char)*c;
    }
    const int length = snprintf(line, sizeof line, "$%s*%02X\r\n", body, sum);
    CHECK(length > 0 && length < LINE_BYTES);
    int found = 0;
    for (int i = 0; i < length; i++) {
        found += gnss_nmea_take(nmea, (uint8_t)line[i], fix);
    }
    return found;
}

static int feed_text(gnss_nmea_t *nmea, const char *text, gnss_fix_t *fix)
{
    int found = 0;
    for (const char *c = text; *c != '\0'; c++) {
        found += gnss_nmea_take(nmea, (uint8_t)*c, fix);
    }
    return found;
}

/* The examples of u-blox's protocol specification, whose times differ, and those of gpsinformation.org, whose do not. */
static void check_published_nmea(void)
{
    static gnss_nmea_t nmea;
    gnss_fix_t fix;
    CHECK(feed_text(&nmea, "$GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n", &fix) == 0);
    CHECK(feed_text(&nmea, "$GPRMC,083559.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*57\r\n", &fix) == 0);
    CHECK(nmea.stream.why == FCSL_DRIVER_RMC_ALONE && nmea.stream.garbage == 0);
    CHECK(feed_text(&nmea, "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n", &fix) == 0);
    CHECK(feed_text(&nmea, "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n", &fix) == 1);
    CHECK(fix.kind == GNSS_3D && fix.satellites == 8 && fix.dilution == 0.9f);
    CHECK(fix.latitude_deg == 48.0 + 7.038 / 60.0 && fix.longitude_deg == 11.0 + 31.0 / 60.0);
    CHECK(fix.altitude_m == 545.4 && fabs(fix.height_m - 592.3) < 1e-9);
    CHECK(fix.ground_speed_mps == (float)(22.4 * 1852.0 / 3600.0) && fix.course_deg == 84.4f);
    CHECK(fix.has_utc && fix.utc_ns == INT64_C(764426119) * 1000000000);
    CHECK(isnan(fix.velocity_ned_mps[0]) && isnan(fix.horizontal_m));
}

static void check_signs_and_order(void)
{
    static gnss_nmea_t nmea;
    gnss_fix_t fix;
    CHECK(feed_nmea(&nmea, "GNRMC,235959.75,A,3351.4,S,15112.3,W,,,311299,,,D", &fix) == 0);
    CHECK(feed_nmea(&nmea, "GNGSA,A,3,01,02,,,,,,,,,,,1.5,1.0,1.1", &fix) == 0);
    CHECK(feed_nmea(&nmea, "GNGGA,235959.75,3351.4,S,15112.3,W,4,12,0.5,-3.25,M,-10.0,M,1.0,0000", &fix) == 1);
    CHECK(fix.latitude_deg < -33.8 && fix.longitude_deg < -151.2 && fix.altitude_m == -3.25 && fix.height_m == -13.25);
    CHECK(isnan(fix.ground_speed_mps) && isnan(fix.course_deg));
    CHECK(fix.utc_ns == INT64_C(946684799) * 1000000000 + 750000000);
    /* A receiver that has no position yet. */
    CHECK(feed_nmea(&nmea, "GNRMC,000000.00,V,,,,,,,,,,N", &fix) == 0);
    CHECK(feed_nmea(&nmea, "GNGGA,000000.00,,,,,0,00,99.99,,,,,,", &fix) == 1);
    CHECK(fix.kind == GNSS_NO_FIX && !fix.has_utc && isnan(fix.latitude_deg) && nmea.stream.why < FCSL_DRIVER_NO_TIME);
}

/* What both sentences must say for a fix, in either order. */
static void check_what_is_a_fix(void)
{
    static const struct {
        const char *quality;
        const char *status;
        const char *rest; /* of RMC: mode and integrity */
        gnss_fix_kind_t kind;
    } CASES[] = {
        {"1", "A", ",A", GNSS_3D},       {"2", "A", ",D,S", GNSS_3D},     {"3", "A", ",P,C", GNSS_3D},
        {"4", "A", ",R,V", GNSS_3D},     {"5", "A", ",F", GNSS_3D},       {"9", "A", ",D", GNSS_3D},
        {"1", "A", "", GNSS_3D}, /* before NMEA 2.3 */
        {"0", "A", ",A", GNSS_NO_FIX},   {"6", "A", ",A", GNSS_NO_FIX},   {"7", "A", ",A", GNSS_NO_FIX},
        {"8", "A", ",A", GNSS_NO_FIX},   {"", "A", ",A", GNSS_NO_FIX},    {"12", "A", ",A", GNSS_NO_FIX},
        {"1", "V", ",A", GNSS_NO_FIX},   {"1", "", ",A", GNSS_NO_FIX},    {"1", "A", ",N", GNSS_NO_FIX},
        {"1", "A", ",E", GNSS_NO_FIX},   {"1", "A", ",M", GNSS_NO_FIX},   {"1", "A", ",S", GNSS_NO_FIX},
        {"1", "A", ",A,U", GNSS_NO_FIX}, {"6", "V", ",E,V", GNSS_NO_FIX},
    };
    for (size_t i = 0; i < 2u * sizeof CASES / sizeof CASES[0]; i++) {
        gnss_nmea_t nmea = {0};
        gnss_fix_t fix;
        char lines[2][LINE_BYTES];
        snprintf(lines[0], sizeof lines[0], "GNGGA,123500.00,4807.0,N,01131.0,E,%s,07,0.9,545.4,M,46.9,M,,",
                 CASES[i / 2u].quality);
        snprintf(lines[1], sizeof lines[1], "GNRMC,123500.00,%s,4807.0,N,01131.0,E,22.4,84.4,230324,,%s",
                 CASES[i / 2u].status, CASES[i / 2u].rest);
        CHECK(feed_nmea(&nmea, lines[i % 2u], &fix) == 0);
        CHECK(feed_nmea(&nmea, lines[1u - i % 2u], &fix) == 1);
        CHECK(fix.kind == CASES[i / 2u].kind && fix.satellites == 7);
    }
}

/* A count that a receiver cannot have counts for nothing; the sentence does. */
static void check_satellites(void)
{
    static const struct {
        const char *text;
        uint32_t satellites;
    } CASES[] = {{"00", 0}, {"7", 7}, {"255", 255}, {"256", 0}, {"999999999999999", 0}, {"-4", 0}, {"4.9", 4}, {"", 0}};
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        gnss_nmea_t nmea = {0};
        gnss_fix_t fix;
        char line[LINE_BYTES];
        const int length =
            snprintf(line, sizeof line, "GPGGA,123519,4807.038,N,01131.000,E,1,%s,0.9,5.4,M,46.9,M,,", CASES[i].text);
        CHECK(length > 0 && length < LINE_BYTES);
        CHECK(feed_nmea(&nmea, "GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W", &fix) == 0);
        CHECK(feed_nmea(&nmea, line, &fix) == 1 && fix.kind == GNSS_3D && fix.satellites == CASES[i].satellites);
    }
}

static void check_refused(void)
{
    static const char *const LINES[] = {
        "GPGGA,,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,240000,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,126000,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,12a519,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4760.0,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,9000.1,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4717.11399,E,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4717.11399,N,18100.0,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4717.11399,,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,-4717.1,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4717.113991234567890,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4.71.7,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,.,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,123519,4717.1,N,00833.9,E,1,08,1.01,1e3,M,48.0,M,,",
        "GPGGA,123519",
        "GPRMC,123519,A,4717.1,N,00833.9,E,0.0,0.0,320102,,,A",
        "GPRMC,123519,A,4717.1,N,00833.9,E,0.0,0.0,011302,,,A",
        "GPRMC,123519,A,4717.1,N,00833.9,E,0.0,0.0,0101,,,A",
    };
    for (size_t i = 0; i < sizeof LINES / sizeof LINES[0]; i++) {
        gnss_nmea_t nmea = {0};
        gnss_fix_t fix;
        CHECK(feed_nmea(&nmea, LINES[i], &fix) == 0 && nmea.stream.garbage == 0);
        CHECK(nmea.stream.why == (i == 0u ? FCSL_DRIVER_NO_TIME : FCSL_DRIVER_REFUSED));
    }
}

/* What is no sentence is dropped and counted; the next sentence is heard. */
static void check_garbage(void)
{
    static const char *const TEXTS[] = {
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*48\r\n", /* another sum */
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\n",
        "$\r\n",
        "$*00\n",
        "\x01\xFF",
        "$GP\x80GGA*00\r\n",
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*4g\r\n",
        "$GPGGA,1235"};
    for (size_t i = 0; i < sizeof TEXTS / sizeof TEXTS[0]; i++) {
        static gnss_nmea_t nmea;
        gnss_fix_t fix;
        nmea = (gnss_nmea_t){0};
        CHECK(feed_text(&nmea, TEXTS[i], &fix) == 0);
        CHECK(feed_text(&nmea, "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n", &fix) == 0);
        CHECK(feed_text(&nmea, "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n", &fix) == 1);
        CHECK(nmea.stream.garbage == strlen(TEXTS[i]) && nmea.stream.frames == 2);
    }
}

/* The C library's calendar, on every day of 200 years. */
static void check_calendar(void)
{
    for (int64_t day = 3652; day < 3652 + 73000; day++) {
        const time_t seconds = (time_t)(day * 86400);
        struct tm date;
        CHECK(gmtime_r(&seconds, &date) != NULL);
        CHECK(gnss_utc_ns(date.tm_year + 1900, date.tm_mon + 1, date.tm_mday, 7) == day * INT64_C(86400000000000) + 7);
    }
}

int main(void)
{
    check_pvt();
    check_damaged_ubx();
    check_published_nmea();
    check_signs_and_order();
    check_what_is_a_fix();
    check_satellites();
    check_refused();
    check_garbage();
    check_calendar();
    return 0;
}
