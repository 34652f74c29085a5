/* SPDX-License-Identifier: Apache-2.0
 *
 * What main.py gives to EVA: the parsers of receivers, in any state, take any byte. They leave a state of those again, so a
 * stream may have any length and any bytes.
 */
#include "gnss.h"
#include "rc.h"
#include "tfmini.h"

enum { STREAM = 1, END = 2, UBX = 4, NMEA = 8, SBUS = 16, CRSF = 32, TFMINI = 64 };
#ifndef PARTS
#define PARTS (STREAM | END | UBX | NMEA | SBUS | CRSF | TFMINI)
#endif
#ifndef TURNS
#define TURNS BYTE_STREAM_MAX
#endif

volatile uint8_t any_u8;
volatile int32_t any_i32;
volatile uint32_t any_u32;
volatile int64_t any_i64;
volatile uint64_t any_u64;
volatile float any_f32;
volatile double any_f64;

/* What holds between calls: `size` and `taken` lie within the memory. Zero, as a driver begins, is one of these states. */
static void any_stream(byte_stream_t *stream)
{
    for (uint32_t i = 0; i < BYTE_STREAM_MAX; i++) {
        stream->bytes[i] = any_u8;
    }
    stream->size = any_u32 % (BYTE_STREAM_MAX + 1u);
    stream->taken = any_u32 % (BYTE_STREAM_MAX + 1u);
    stream->frames = any_u64;
    stream->garbage = any_u64;
    stream->why = any_u32;
}

static void check_stream(const byte_stream_t *stream)
{
    //@ assert stream->size <= BYTE_STREAM_MAX;
    //@ assert stream->taken <= BYTE_STREAM_MAX;
}

/* ---- the stream alone --------------------------------------------------------------------------------------------------- */

/* Reads all that it is given, and says anything. */
static int32_t any_judge(const uint8_t *bytes, uint32_t size)
{
    //@ assert 1 <= size <= BYTE_STREAM_MAX;
    const int both = bytes[0] + bytes[size - 1u];
    (void)both;
    return any_i32;
}

static void take_any_frame(void)
{
    static byte_stream_t stream;
    any_stream(&stream);
    const uint32_t size = byte_stream_take(&stream, any_u8, any_judge);
    check_stream(&stream);
    //@ assert size <= BYTE_STREAM_MAX;
    (void)size;
}

/* Every turn but the last counts a byte as garbage. From zero on, this tells the turns apart: EVA follows each of them. */
static void count_turns(void)
{
    static byte_stream_t stream;
    any_stream(&stream);
    stream.size = any_u32 % TURNS;
    stream.garbage = 0;
    (void)byte_stream_take(&stream, any_u8, any_judge);
    //@ assert stream.garbage <= TURNS;
}

static void report_stream(void)
{
    static byte_stream_t stream;
    fcsl_driver_input_t input = {.why = any_u32};
    any_stream(&stream);
    byte_stream_report(&stream, &input);
    //@ assert stream.garbage == 0 && stream.frames == 0;
}

static void break_stream(void)
{
    static byte_stream_t stream;
    any_stream(&stream);
    byte_stream_break(&stream);
    //@ assert stream.size == 0 && stream.taken == 0;
}

/* ---- satellite navigation ----------------------------------------------------------------------------------------------- */

static void check_fix(const gnss_fix_t *fix)
{
    //@ assert fix->kind == GNSS_NO_FIX || fix->kind == GNSS_2D || fix->kind == GNSS_3D;
    //@ assert fix->satellites <= 255;
}

static void take_ubx(void)
{
    static gnss_ubx_t ubx;
    gnss_fix_t fix;
    any_stream(&ubx.stream);
    if (gnss_ubx_take(&ubx, any_u8, &fix) != 0) {
        check_fix(&fix);
    }
    check_stream(&ubx.stream);
}

/* Half a solution, of whatever sentences came. */
static void any_fix(gnss_fix_t *fix)
{
    fix->kind = any_u8 % 2u != 0u ? GNSS_NO_FIX : any_u8 % 2u != 0u ? GNSS_2D : GNSS_3D;
    fix->satellites = any_u8;
    fix->has_utc = any_i32;
    fix->utc_ns = any_i64;
    fix->latitude_deg = any_f64;
    fix->longitude_deg = any_f64;
    fix->altitude_m = any_f64;
    fix->height_m = any_f64;
    for (int i = 0; i < 3; i++) {
        fix->velocity_ned_mps[i] = any_f32;
    }
    fix->ground_speed_mps = any_f32;
    fix->course_deg = any_f32;
    fix->horizontal_m = any_f32;
    fix->vertical_m = any_f32;
    fix->speed_mps = any_f32;
    fix->dilution = any_f32;
}

static void take_nmea(void)
{
    static gnss_nmea_t nmea;
    gnss_fix_t fix;
    any_stream(&nmea.stream);
    any_fix(&nmea.fix);
    nmea.ns_of_day = any_i64;
    nmea.seen = any_u32;
    if (gnss_nmea_take(&nmea, any_u8, &fix) != 0) {
        check_fix(&fix);
    }
    check_stream(&nmea.stream);
    check_fix(&nmea.fix);
}

/* ---- remote controls ---------------------------------------------------------------------------------------------------- */

/* The pulses of 11 bits: (0 - 992) and (2047 - 992) steps of 0.625 us beside the middle. */
static void check_frame(const rc_frame_t *frame, uint32_t count)
{
    //@ assert frame->count == count;
    for (uint32_t i = 0; i < count; i++) {
        //@ assert 880.0 <= frame->pulse_us[i] <= 2159.375;
    }
}

static void take_sbus(void)
{
    static rc_sbus_t sbus;
    rc_frame_t frame;
    any_stream(&sbus.stream);
    sbus.in_sync = any_i32;
    if (rc_sbus_take(&sbus, any_u8, &frame) != 0) {
        check_frame(&frame, RC_CHANNELS_MAX);
    }
    check_stream(&sbus.stream);
}

static void take_crsf(void)
{
    static rc_crsf_t crsf;
    rc_frame_t frame;
    rc_link_t link;
    any_stream(&crsf.stream);
    const rc_crsf_kind_t kind = rc_crsf_take(&crsf, any_u8, &frame, &link);
    if (kind == RC_CRSF_CHANNELS) {
        check_frame(&frame, RC_PACKED_CHANNELS);
    } else if (kind == RC_CRSF_LINK) {
        //@ assert -255 <= link.rssi_dbm <= 0 && link.quality_percent <= 255 && -128 <= link.snr_db <= 127;
    }
    check_stream(&crsf.stream);
}

/* ---- a range finder ------------------------------------------------------------------------------------------------------ */

static void take_tfmini(void)
{
    static tfmini_t tfmini;
    tfmini_reading_t reading;
    any_stream(&tfmini.stream);
    if (tfmini_take(&tfmini, any_u8, &reading) != 0) {
        //@ assert reading.distance_cm <= 65535 && reading.strength <= 65535;
        //@ assert -256.0 <= reading.temperature_degc <= 7935.875;
    }
    check_stream(&tfmini.stream);
}

int main(void)
{
    if ((PARTS & STREAM) != 0) {
        take_any_frame();
        break_stream();
        report_stream();
    }
    if ((PARTS & END) != 0) {
        count_turns();
    }
    if ((PARTS & UBX) != 0) {
        take_ubx();
    }
    if ((PARTS & NMEA) != 0) {
        take_nmea();
    }
    if ((PARTS & SBUS) != 0) {
        take_sbus();
    }
    if ((PARTS & CRSF) != 0) {
        take_crsf();
    }
    if ((PARTS & TFMINI) != 0) {
        take_tfmini();
    }
    return 0;
}
