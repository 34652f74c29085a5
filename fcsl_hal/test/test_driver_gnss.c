/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `ubx` and `nmea` on a pseudo terminal.
 */
#define _GNU_SOURCE
#include <math.h>

#include "drivers.h"
#include "serial_rig.h"

enum { PVT_FRAME = 100 };

/* Made with pyubx2 1.4.0: UBXMessage("NAV", "NAV-PVT", GET, fixType=3, gnssFixOk=1, numSV=17, lon=-122.4194155, lat=37.7749295,
 * height=48123, hMSL=80456, hAcc=1250, vAcc=1870, velN=12345, velE=-6789, velD=321, sAcc=210, …).serialize() */
static const uint8_t PVT[PVT_FRAME] = {
    0xB5, 0x62, 0x01, 0x07, 0x5C, 0x00, 0x00, 0xCA, 0x5B, 0x07, 0xE8, 0x07, 0x05, 0x11, 0x0A, 0x11, 0x24,
    0x03, 0x19, 0x00, 0x00, 0x00, 0x2E, 0xFB, 0xFF, 0xFF, 0x03, 0x01, 0x00, 0x11, 0x95, 0x47, 0x08, 0xB7,
    0x2F, 0xFF, 0x83, 0x16, 0xFB, 0xBB, 0x00, 0x00, 0x48, 0x3A, 0x01, 0x00, 0xE2, 0x04, 0x00, 0x00, 0x4E,
    0x07, 0x00, 0x00, 0x39, 0x30, 0x00, 0x00, 0x7B, 0xE5, 0xFF, 0xFF, 0x41, 0x01, 0x00, 0x00, 0x09, 0x37,
    0x00, 0x00, 0x17, 0x5B, 0xF9, 0x01, 0xD2, 0x00, 0x00, 0x00, 0xBF, 0xD4, 0x01, 0x00, 0x9B, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xB8, 0x4D};
/* The same with fixType=0, numSV=3, lon=1.0, lat=2.0, height=1, hMSL=2, hAcc=4294967295. */
static const uint8_t NO_FIX[PVT_FRAME] = {
    0xB5, 0x62, 0x01, 0x07, 0x5C, 0x00, 0xC8, 0xCA, 0x5B, 0x07, 0xE8, 0x07, 0x05, 0x11, 0x0A, 0x11, 0x24,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x03, 0x80, 0x96, 0x98, 0x00,
    0x00, 0x2D, 0x31, 0x01, 0x01, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xAB, 0xF4};
/* The beginning of a message of 1000 bytes, which hides the frames behind it until it proves wrong. */
static const uint8_t FALSE_HEAD[] = {0xB5, 0x62, 0x01, 0x07, 0xE8, 0x03};

/* Made with pynmea2 1.19.0: str(GGA("GN", "GGA", …)), str(RMC("GN", "RMC", …)); parse() gives the values below. */
static const char GGA[] = "$GNGGA,101736.40,3746.49577,N,12225.16493,W,1,11,0.84,80.4,M,-32.3,M,,*48\r\n";
static const char RMC[] = "$GNRMC,101736.40,A,3746.49577,N,12225.16493,W,27.386,331.19,170524,,,A*51\r\n";
/* Of a receiver that has no position yet. */
static const char NO_POSITION[] = "$GNRMC,000000.00,V,,,,,,,,,,N*63\r\n$GNGGA,000000.00,,,,,0,00,99.99,,,,,,*78\r\n";
static const char NO_COURSE[] = "$GNGGA,101737.40,3746.49577,N,12225.16493,W,1,11,0.84,80.4,M,-32.3,M,,*49\r\n"
                                "$GNRMC,101737.40,A,3746.49577,N,12225.16493,W,0.006,,170524,,,A*79\r\n";
static const uint8_t GARBAGE[] = {0xFF, 0x55, 0xAA, 0x7E, 0x24, 0xB5};

static int is_near(double value, double expected, double tolerance)
{
    return fabs(value - expected) <= tolerance;
}

static void check_no_values(const rig_t *rig, double satellites)
{
    static const char *const NAMES[] = {
        "latitude", "longitude", "altitude", "height", "horizontal_accuracy", "vertical_accuracy", "speed_accuracy"};
    CHECK(rig_value(rig, "fix", 0) == 0.0 && rig_value(rig, "satellites", 0) == satellites);
    for (size_t i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        CHECK(isnan(rig_value(rig, NAMES[i], 0)));
    }
    for (uint32_t i = 0; i < 3u; i++) {
        CHECK(isnan(rig_value(rig, "velocity", i)));
    }
}

/* ---- UBX ---------------------------------------------------------------------------------------------------------------- */

static void check_pvt(const rig_t *rig)
{
    CHECK(rig_value(rig, "fix", 0) == 3.0 && rig_value(rig, "satellites", 0) == 17.0);
    CHECK(rig_value(rig, "latitude", 0) == 37.7749295 && rig_value(rig, "longitude", 0) == -122.4194155);
    CHECK(rig_value(rig, "height", 0) == 48.123 && rig_value(rig, "altitude", 0) == 80.456);
    CHECK(is_near(rig_value(rig, "velocity", 0), 12.345, 1e-6) && is_near(rig_value(rig, "velocity", 1), -6.789, 1e-6));
    CHECK(is_near(rig_value(rig, "velocity", 2), 0.321, 1e-7));
    CHECK(is_near(rig_value(rig, "horizontal_accuracy", 0), 1.25, 1e-6));
    CHECK(is_near(rig_value(rig, "vertical_accuracy", 0), 1.87, 1e-6));
    CHECK(is_near(rig_value(rig, "speed_accuracy", 0), 0.21, 1e-7));
}

static void check_ubx(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_ubx, line.name) == FCSL_DRIVER_OK);
    CHECK(serial_rig_mode(&line).c_ospeed == 38400u);
    serial_rig_send(&line, PVT, PVT_FRAME);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    check_pvt(&rig);
    serial_rig_send(&line, NO_FIX, PVT_FRAME);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    check_no_values(&rig, 3.0);
    for (size_t first = 1; first < PVT_FRAME; first++) {
        serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
        CHECK(serial_rig_read_parts(&rig, (serial_parts_t){&line, PVT, PVT_FRAME, first, 0}) == FCSL_DRIVER_OK);
        check_pvt(&rig);
    }
    rig_close(&rig);
    (void)close(line.master);
}

/* A solution has the time of its first byte, which a read before it took. */
static void check_ubx_time(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_ubx, line.name) == FCSL_DRIVER_OK);
    serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t begin_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, PVT, 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t rest_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, PVT + 1, PVT_FRAME - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rig.sample_ns > begin_ns && rig.sample_ns < rest_ns);
    rig_close(&rig);
    (void)close(line.master);
}

/* What a false beginning hid comes later, with the times of its own bytes; of several solutions at once the last one counts. */
static void check_hidden_ubx(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_ubx, line.name) == FCSL_DRIVER_OK);
    serial_rig_send(&line, FALSE_HEAD, sizeof FALSE_HEAD);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t begin_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, PVT, PVT_FRAME);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t second_ns = fcsl_monotonic_ns();
    for (int i = 1; i < 10; i++) { /* 1006 bytes, 2 short of the message's end */
        serial_rig_send(&line, PVT, PVT_FRAME);
        CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    }
    const uint64_t end_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, NO_FIX, 2);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns > begin_ns && rig.sample_ns < second_ns);
    serial_rig_send(&line, NO_FIX + 2, PVT_FRAME - 2);
    while (rig_value(&rig, "fix", 0) == 3.0) {
        check_pvt(&rig);
        CHECK(rig.sample_ns > begin_ns && rig.sample_ns < end_ns);
        CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    }
    CHECK(rig.sample_ns > end_ns);
    rig_close(&rig);
    (void)close(line.master);
}

/* ---- NMEA --------------------------------------------------------------------------------------------------------------- */

static void check_motion(const rig_t *rig)
{
    CHECK(rig_value(rig, "fix", 0) == 3.0 && rig_value(rig, "satellites", 0) == 11.0);
    CHECK(rig_value(rig, "latitude", 0) == 37.7749295 && rig_value(rig, "longitude", 0) == -122.4194155);
    CHECK(rig_value(rig, "altitude", 0) == 80.4 && is_near(rig_value(rig, "height", 0), 48.1, 1e-9));
    CHECK(is_near(rig_value(rig, "velocity", 0), 12.344728089712442, 1e-5));
    CHECK(is_near(rig_value(rig, "velocity", 1), -6.789377701649989, 1e-5));
    CHECK(isnan(rig_value(rig, "velocity", 2)) && isnan(rig_value(rig, "horizontal_accuracy", 0)));
    CHECK(isnan(rig_value(rig, "vertical_accuracy", 0)) && isnan(rig_value(rig, "speed_accuracy", 0)));
}

static void check_nmea(void)
{
    static rig_t rig;
    char both[sizeof GGA + sizeof RMC];
    const int size = snprintf(both, sizeof both, "%s%s", GGA, RMC);
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_nmea, line.name) == FCSL_DRIVER_OK);
    CHECK(serial_rig_mode(&line).c_ospeed == 9600u);
    for (size_t first = 1; first < (size_t)size; first++) {
        serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
        CHECK(serial_rig_read_parts(&rig, (serial_parts_t){&line, (const uint8_t *)both, (size_t)size, first, 0}) ==
              FCSL_DRIVER_OK);
        check_motion(&rig);
    }
    serial_rig_send(&line, NO_POSITION, sizeof NO_POSITION - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    check_no_values(&rig, 0.0);
    serial_rig_send(&line, NO_COURSE, sizeof NO_COURSE - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "fix", 0) == 3.0);
    CHECK(isnan(rig_value(&rig, "velocity", 0)) && isnan(rig_value(&rig, "velocity", 1)));
    rig_close(&rig);
    (void)close(line.master);
}

/* The first byte of a solution is that of its first sentence, whichever it is. A sentence of another time begins another one. */
static void check_nmea_time(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_nmea, line.name) == FCSL_DRIVER_OK);
    serial_rig_send(&line, NO_COURSE, sizeof GGA - 1); /* a GGA that stays alone */
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t begin_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, RMC, 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    const uint64_t rest_ns = fcsl_monotonic_ns();
    serial_rig_send(&line, RMC + 1, sizeof RMC - 2);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    serial_rig_send(&line, GGA, sizeof GGA - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns > begin_ns && rig.sample_ns < rest_ns);
    check_motion(&rig);
    serial_rig_send(&line, RMC, sizeof RMC - 1); /* a receiver whose clock stands: another solution of the same time */
    serial_rig_send(&line, GGA, sizeof GGA - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig.sample_ns > rest_ns);
    rig_close(&rig);
    (void)close(line.master);
}

/* NMEA has the first five values, and of the sixth, the velocity, only what is horizontal. */
static void check_needed(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open_needed(&rig, &fcsl_driver_nmea, line.name, 5) == FCSL_DRIVER_OK);
    rig_close(&rig);
    CHECK(rig_open_needed(&rig, &fcsl_driver_nmea, line.name, 6) == FCSL_DRIVER_FAILED);
    CHECK(strstr(rig.why, "velocity is needed, and NMEA does not tell how fast it goes down") != NULL);
    CHECK(rig_open_needed(&rig, &fcsl_driver_ubx, line.name, 10) == FCSL_DRIVER_OK);
    rig_close(&rig);
    (void)close(line.master);
}

int main(void)
{
    serial_rig_check_names(&fcsl_driver_ubx);
    serial_rig_check_life(&fcsl_driver_ubx);
    serial_rig_check_life(&fcsl_driver_nmea);
    check_ubx();
    check_ubx_time();
    check_hidden_ubx();
    check_nmea();
    check_nmea_time();
    check_needed();
    return 0;
}
