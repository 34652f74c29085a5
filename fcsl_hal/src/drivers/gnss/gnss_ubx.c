/* SPDX-License-Identifier: Apache-2.0
 *
 * UBX: B5 62, class, number, length (little-endian), payload, and Fletcher's checksum of all of it behind the first two bytes. The
 * payload of NAV-PVT is that of "u-blox M9 Interface Description", UBX-NAV-PVT.
 */
#include <string.h>

#include "gnss.h"

enum {
    FIRST = 0xB5,
    SECOND = 0x62,
    LENGTH = 4, /* their places */
    PAYLOAD = 6,
    FRAME = 8, /* bytes beside the payload */
    CLASS_NAV = 0x01,
    NUMBER_PVT = 0x07,
    PVT_BYTES = 92,
    PVT_BYTES_OF_7 = 84, /* up to u-blox 7, which lacks the last fields; none of them is read */
    VALID_DATE_TIME = 3,
    YEAR_MIN = 1980,
    YEAR_MAX = 2200, /* 64 bits hold its nanoseconds */
    FIX_OK = 1
};

static uint32_t u16(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8;
}

static uint32_t u32(const uint8_t *bytes)
{
    return u16(bytes) | u16(bytes + 2) << 16;
}

static int32_t i32(const uint8_t *bytes)
{
    const uint32_t bits = u32(bytes);
    int32_t value = 0;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static int32_t judge(const uint8_t *bytes, uint32_t size)
{
    if (bytes[0] != FIRST || (size > 1u && bytes[1] != SECOND)) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    if (size < PAYLOAD) {
        return 0;
    }
    const uint32_t length = u16(bytes + LENGTH) + FRAME;
    if (length > BYTE_STREAM_MAX) {
        return -FCSL_DRIVER_NO_FRAMES;
    }
    if (size < length) {
        return 0;
    }
    uint32_t a = 0;
    uint32_t b = 0;
    //@ loop unroll BYTE_STREAM_MAX;
    for (uint32_t i = 2; i < length - 2u; i++) {
        a = (a + bytes[i]) & 0xFFu;
        b = (b + a) & 0xFFu;
    }
    return a == bytes[length - 2u] && b == bytes[length - 1u] ? (int32_t)length : -FCSL_DRIVER_NO_FRAMES;
}

/* The receiver's own number of the kind of fix: 3 and 4 (with dead reckoning) have an altitude. */
static gnss_fix_kind_t kind_of(const uint8_t *pvt)
{
    const uint8_t type = pvt[20];
    if ((pvt[21] & FIX_OK) == 0) {
        return GNSS_NO_FIX;
    }
    return type == 2u ? GNSS_2D : type == 3u || type == 4u ? GNSS_3D : GNSS_NO_FIX;
}

/* Date and time, where the receiver says that it knows them, and they can be. */
static void read_utc(const uint8_t *pvt, gnss_fix_t *fix)
{
    const uint32_t year = u16(pvt + 4);
    const int month = pvt[6];
    const int day = pvt[7];
    if ((pvt[11] & VALID_DATE_TIME) != VALID_DATE_TIME || year < YEAR_MIN || year > YEAR_MAX || month < 1 ||
        month > 12 || day < 1 || day > 31) {
        return;
    }
    const int64_t seconds = pvt[8] * 3600 + pvt[9] * 60 + pvt[10];
    fix->has_utc = 1;
    fix->utc_ns = gnss_utc_ns((int)year, month, day, seconds * 1000000000 + i32(pvt + 16));
}

static gnss_fix_t read_pvt(const uint8_t *pvt)
{
    gnss_fix_t fix = gnss_no_fix();
    fix.kind = kind_of(pvt);
    fix.satellites = pvt[23];
    read_utc(pvt, &fix);
    fix.longitude_deg = i32(pvt + 24) / 1e7;
    fix.latitude_deg = i32(pvt + 28) / 1e7;
    fix.height_m = i32(pvt + 32) / 1e3;
    fix.altitude_m = i32(pvt + 36) / 1e3;
    fix.horizontal_m = (float)(u32(pvt + 40) / 1e3);
    fix.vertical_m = (float)(u32(pvt + 44) / 1e3);
    for (uint32_t i = 0; i < 3u; i++) {
        fix.velocity_ned_mps[i] = (float)(i32(pvt + 48 + 4u * i) / 1e3);
    }
    fix.ground_speed_mps = (float)(i32(pvt + 60) / 1e3);
    fix.course_deg = (float)(i32(pvt + 64) / 1e5);
    fix.speed_mps = (float)(u32(pvt + 68) / 1e3);
    fix.dilution = (float)(u16(pvt + 76) / 1e2);
    return fix;
}

int gnss_ubx_take(gnss_ubx_t *ubx, uint8_t byte, gnss_fix_t *fix)
{
    const uint8_t *bytes = ubx->stream.bytes;
    const uint32_t size = byte_stream_take(&ubx->stream, byte, judge);
    if (size == 0u) {
        return 0;
    }
    if (bytes[2] != CLASS_NAV || bytes[3] != NUMBER_PVT) {
        byte_stream_note(&ubx->stream, FCSL_DRIVER_OTHER_FRAMES);
        return 0;
    }
    if (size != PVT_BYTES + FRAME && size != PVT_BYTES_OF_7 + FRAME) {
        byte_stream_note(&ubx->stream, FCSL_DRIVER_REFUSED);
        return 0;
    }
    *fix = read_pvt(bytes + PAYLOAD);
    return 1;
}
