/* SPDX-License-Identifier: Apache-2.0
 *
 * What serial drivers tell of the bytes that arrive: each is counted once, however the port cuts them, and where no sample comes
 * of them, the reason is told.
 */
#define _GNU_SOURCE
#include "drivers.h"
#include "serial_rig.h"

enum { STREAM_BYTES = 1024, SBUS_BYTES = 25, CRSF_BYTES = 26, LINK_BYTES = 14, PVT_FRAME = 100, FLAGS = 23 };

/* The frames of the tests of these drivers. */
static const uint8_t SBUS[SBUS_BYTES] = {0x0F, 0xE0, 0x03, 0x1F, 0x58, 0xC0, 0x07, 0x16, 0xB0, 0x80, 0x05, 0x2C, 0x60,
                                         0x01, 0x0B, 0xF8, 0xC0, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x03, 0x00};
static const uint8_t CRSF[CRSF_BYTES] = {0x00, 0x18, 0x16, 0xBD, 0x08, 0x9F, 0xF4, 0xAE, 0xF7, 0xBD, 0xEF, 0x7D, 0xEF,
                                         0xFB, 0xAD, 0xFD, 0x45, 0x2B, 0x5A, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x6C};
static const uint8_t LINK[LINK_BYTES] = {0xC8, 0x0C, 0x14, 0x32, 0x2D, 0x64, 0xF6,
                                         0x00, 0x02, 0x03, 0x40, 0x62, 0x0C, 0x8A};
static const uint8_t PVT[PVT_FRAME] = {
    0xB5, 0x62, 0x01, 0x07, 0x5C, 0x00, 0x00, 0xCA, 0x5B, 0x07, 0xE8, 0x07, 0x05, 0x11, 0x0A, 0x11, 0x24,
    0x03, 0x19, 0x00, 0x00, 0x00, 0x2E, 0xFB, 0xFF, 0xFF, 0x03, 0x01, 0x00, 0x11, 0x95, 0x47, 0x08, 0xB7,
    0x2F, 0xFF, 0x83, 0x16, 0xFB, 0xBB, 0x00, 0x00, 0x48, 0x3A, 0x01, 0x00, 0xE2, 0x04, 0x00, 0x00, 0x4E,
    0x07, 0x00, 0x00, 0x39, 0x30, 0x00, 0x00, 0x7B, 0xE5, 0xFF, 0xFF, 0x41, 0x01, 0x00, 0x00, 0x09, 0x37,
    0x00, 0x00, 0x17, 0x5B, 0xF9, 0x01, 0xD2, 0x00, 0x00, 0x00, 0xBF, 0xD4, 0x01, 0x00, 0x9B, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xB8, 0x4D};
static const uint8_t TFMINI[] = {0x59, 0x59, 0x79, 0x00, 0xE8, 0x03, 0xC8, 0x08, 0xE6};
static const uint8_t ACK[] = {0xB5, 0x62, 0x05, 0x01, 0x02, 0x00, 0x06, 0x01, 0x0F, 0x38};
static const uint8_t GARBAGE[] = {0xFF, 0x55, 0xAA, 0x7E, 0x24, 0xB5};
#define GGA          "$GNGGA,101736.40,3746.49577,N,12225.16493,W,1,11,0.84,80.4,M,-32.3,M,,*48"
#define RMC          "$GNRMC,101736.40,A,3746.49577,N,12225.16493,W,27.386,331.19,170524,,,A*51"
#define RMC_LATER    "$GNRMC,101737.40,A,3746.49577,N,12225.16493,W,27.386,331.19,170524,,,A*50"
#define GGA_TIMELESS "$GNGGA,,,,,,0,00,99.99,,,,,,*56"
#define RMC_TIMELESS "$GNRMC,,V,,,,,,,,,,N*4D"
#define GGA_WRONG    "$GNGGA,250000.00,3746.49577,N,12225.16493,W,1,11,0.84,80.4,M,-32.3,M,,*49"
#define GSA          "$GNGSA,A,3,01,02,,,,,,,,,,,1.5,1.0,1.1*2A"

typedef struct {
    uint8_t bytes[STREAM_BYTES];
    size_t size;
} stream_t;

static void put(stream_t *stream, const void *bytes, size_t size)
{
    CHECK(stream->size + size <= sizeof stream->bytes);
    memcpy(stream->bytes + stream->size, bytes, size);
    stream->size += size;
}

/* ---- counts -------------------------------------------------------------------------------------------------------------- */

typedef struct {
    const serial_rig_t *line;
    const stream_t *stream;
    size_t piece;
} pieces_t;

static void *send_pieces(void *argument)
{
    const pieces_t *pieces = argument;
    const stream_t *stream = pieces->stream;
    for (size_t at = 0; at < stream->size; at += pieces->piece) {
        const size_t left = stream->size - at;
        serial_rig_send(pieces->line, stream->bytes + at, left < pieces->piece ? left : pieces->piece);
        fcsl_monotonic_wait(fcsl_monotonic_ns() + 100000u);
    }
    return NULL;
}

/* What the driver has told when all bytes have been read. */
static fcsl_driver_input_t input_of(const fcsl_driver_t *driver, const stream_t *stream, size_t piece)
{
    static rig_t rig;
    pthread_t sender;
    const serial_rig_t line = serial_rig_open();
    pieces_t pieces = {&line, stream, piece};
    CHECK(rig_open(&rig, driver, line.name) == FCSL_DRIVER_OK);
    CHECK(pthread_create(&sender, NULL, send_pieces, &pieces) == 0);
    while (rig.input.bytes < stream->size) {
        CHECK(rig_read(&rig) <= FCSL_DRIVER_NOTHING);
    }
    CHECK(pthread_join(sender, NULL) == 0);
    rig_close(&rig);
    (void)close(line.master);
    return rig.input;
}

/* A frame, and what is none behind it. */
static void check_counts(const fcsl_driver_t *driver, const uint8_t *frame, size_t frame_bytes)
{
    static const size_t PIECES[] = {1, 2, 3, 7, 12, 25, 64, STREAM_BYTES};
    enum { FRAMES = 6, CUT = 5 };
    stream_t stream = {.size = 0};
    put(&stream, frame, frame_bytes);
    put(&stream, frame, frame_bytes);
    put(&stream, GARBAGE, sizeof GARBAGE);
    put(&stream, frame, frame_bytes - CUT); /* the rest is lost */
    for (int i = 2; i < FRAMES; i++) {
        put(&stream, frame, frame_bytes);
    }
    for (size_t i = 0; i < sizeof PIECES / sizeof PIECES[0]; i++) {
        const fcsl_driver_input_t input = input_of(driver, &stream, PIECES[i]);
        CHECK(input.bytes == stream.size && input.frames == FRAMES);
        CHECK(input.rejected == sizeof GARBAGE + frame_bytes - CUT);
    }
}

/* ---- reasons ------------------------------------------------------------------------------------------------------------- */

static void check_why(const fcsl_driver_t *driver, const void *bytes, size_t size, fcsl_driver_why_t why)
{
    stream_t stream = {.size = 0};
    put(&stream, bytes, size);
    put(&stream, bytes, size);
    const fcsl_driver_input_t input = input_of(driver, &stream, STREAM_BYTES);
    CHECK(input.why == (uint32_t)why);
}

static void check_text(const char *text, fcsl_driver_why_t why)
{
    check_why(&fcsl_driver_nmea, text, strlen(text), why);
}

static void check_reasons(void)
{
    uint8_t repeated[SBUS_BYTES];
    memcpy(repeated, SBUS, sizeof repeated);
    repeated[FLAGS] = 0x04;
    check_text(GGA "\n" RMC "\n", FCSL_DRIVER_LINE_ENDS);
    check_text(GGA "\r" RMC "\r", FCSL_DRIVER_LINE_ENDS);
    check_text("$GNGGA,101736.40,3746.49577,N\r\n", FCSL_DRIVER_NO_CHECKSUMS);
    check_text(GSA "\r\n", FCSL_DRIVER_OTHER_FRAMES);
    check_text(GSA "\r\n" GGA "\r\n", FCSL_DRIVER_GGA_ALONE);
    check_text(GSA "\r\n" RMC "\r\n", FCSL_DRIVER_RMC_ALONE);
    check_text(GGA "\r\n" RMC_LATER "\r\n", FCSL_DRIVER_RMC_ALONE);
    check_text(RMC_TIMELESS "\r\n" GGA_TIMELESS "\r\n" GSA "\r\n", FCSL_DRIVER_NO_TIME);
    check_text(GGA_WRONG "\r\n" RMC "\r\n", FCSL_DRIVER_REFUSED);
    check_why(&fcsl_driver_nmea, PVT, sizeof PVT, FCSL_DRIVER_NO_FRAMES);
    check_why(&fcsl_driver_ubx, GGA "\r\n", sizeof GGA + 1u, FCSL_DRIVER_NO_FRAMES);
    check_why(&fcsl_driver_ubx, ACK, sizeof ACK, FCSL_DRIVER_OTHER_FRAMES);
    check_why(&fcsl_driver_sbus, CRSF, sizeof CRSF, FCSL_DRIVER_NO_FRAMES);
    check_why(&fcsl_driver_sbus, repeated, sizeof repeated, FCSL_DRIVER_REPEATED);
    check_why(&fcsl_driver_crsf, GGA, sizeof GGA, FCSL_DRIVER_NO_FRAMES);
    check_why(&fcsl_driver_tfmini, GGA, sizeof GGA, FCSL_DRIVER_NO_FRAMES);
    check_why(&fcsl_driver_crsf, LINK, sizeof LINK, FCSL_DRIVER_OTHER_FRAMES);
}

int main(void)
{
    check_counts(&fcsl_driver_sbus, SBUS, sizeof SBUS);
    check_counts(&fcsl_driver_crsf, CRSF, sizeof CRSF);
    check_counts(&fcsl_driver_ubx, PVT, sizeof PVT);
    check_counts(&fcsl_driver_nmea, (const uint8_t *)GGA "\r\n", sizeof GGA + 1u);
    check_counts(&fcsl_driver_tfmini, TFMINI, sizeof TFMINI);
    check_reasons();
    return 0;
}
