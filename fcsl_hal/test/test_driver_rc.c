/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `sbus` and `crsf` on a pseudo terminal.
 */
#define _GNU_SOURCE
#include <math.h>

#include "drivers.h"
#include "serial_rig.h"

enum { SBUS_BYTES = 25, CRSF_BYTES = 26, LINK_BYTES = 14, FLAGS = 23 };

/* The frames of test_rc.c. */
static const uint8_t SBUS[SBUS_BYTES] = {0x0F, 0xE0, 0x03, 0x1F, 0x58, 0xC0, 0x07, 0x16, 0xB0, 0x80, 0x05, 0x2C, 0x60,
                                         0x01, 0x0B, 0xF8, 0xC0, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x03, 0x00};
static const int SBUS_STEPS[] = {992, 992, 352, 992, 352, 352, 352, 352, 352, 352, 992, 992, 0, 0, 0, 0};
static const uint8_t CRSF[CRSF_BYTES] = {0x00, 0x18, 0x16, 0xBD, 0x08, 0x9F, 0xF4, 0xAE, 0xF7, 0xBD, 0xEF, 0x7D, 0xEF,
                                         0xFB, 0xAD, 0xFD, 0x45, 0x2B, 0x5A, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x6C};
static const int CRSF_STEPS[] = {189, 993, 978, 983, 991, 991, 991, 2015, 1453, 191, 173, 173, 0, 0, 0, 0};
static const uint8_t LINK[LINK_BYTES] = {0xC8, 0x0C, 0x14, 0x32, 0x2D, 0x64, 0xF6,
                                         0x00, 0x02, 0x03, 0x40, 0x62, 0x0C, 0x8A};
static const uint8_t LINK_LOST[LINK_BYTES] = {0xC8, 0x0C, 0x14, 0x78, 0x78, 0x00, 0xEC,
                                              0x00, 0x02, 0x03, 0x00, 0x00, 0x00, 0x6C}; /* quality 0, -120 dBm */
static const uint8_t GARBAGE[] = {0xFF, 0x55, 0xAA, 0x7E, 0xFF};

static int has_steps(const rig_t *rig, const int *steps)
{
    for (uint32_t i = 0; i < 16u; i++) {
        if (rig_value(rig, "sticks", i) != 1500.0 + (steps[i] - 992) * 0.625) {
            return 0;
        }
    }
    return 1;
}

/* As long as adapters keep bytes. */
static void pause_line(void)
{
    fcsl_monotonic_wait(fcsl_monotonic_ns() + 5u * FCSL_NS_PER_MS);
}

/* ---- SBUS --------------------------------------------------------------------------------------------------------------- */

/* Two frames: the driver knows where they begin. */
static void begin_sbus(rig_t *rig, const serial_rig_t *line)
{
    serial_rig_send(line, SBUS, SBUS_BYTES);
    serial_rig_send(line, SBUS, SBUS_BYTES);
    CHECK(rig_read(rig) == FCSL_DRIVER_OK && has_steps(rig, SBUS_STEPS));
}

static void check_sbus(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_sbus, line.name) == FCSL_DRIVER_OK);
    const struct termios2 mode = serial_rig_mode(&line);
    CHECK(mode.c_ospeed == 100000u && (mode.c_cflag & CSTOPB) != 0u && (mode.c_iflag & INPCK) != 0u);
    CHECK(isnan(rig_value(&rig, "sticks", 0)) && mode.c_lflag == 0u && mode.c_oflag == 0u);
    const uint64_t before_ns = fcsl_monotonic_ns();
    begin_sbus(&rig, &line);
    CHECK(rig.sample_ns > before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    CHECK(rig_value(&rig, "sticks", 16) == 2000.0 && rig_value(&rig, "sticks", 17) == 2000.0);
    CHECK(rig_value(&rig, "failsafe", 0) == 0.0);
    rig_close(&rig);
    (void)close(line.master);
}

/* A repeated frame is no sample, and its values are not taken; failsafe is one, with either flag. */
static void check_sbus_flags(void)
{
    static rig_t rig;
    static const struct {
        uint8_t flags;
        fcsl_driver_status_t status;
        double failsafe;
    } CASES[] = {{0x04, FCSL_DRIVER_NOTHING, 0.0},
                 {0x08, FCSL_DRIVER_OK, 1.0},
                 {0x04, FCSL_DRIVER_NOTHING, 1.0},
                 {0x0C, FCSL_DRIVER_OK, 1.0},
                 {0x00, FCSL_DRIVER_OK, 0.0}};
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_sbus, line.name) == FCSL_DRIVER_OK);
    begin_sbus(&rig, &line);
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        uint8_t bytes[SBUS_BYTES];
        memcpy(bytes, SBUS, sizeof bytes);
        bytes[FLAGS] = CASES[i].flags;
        serial_rig_send(&line, bytes, sizeof bytes);
        CHECK(rig_read(&rig) == CASES[i].status && rig_value(&rig, "failsafe", 0) == CASES[i].failsafe);
        CHECK(CASES[i].status == FCSL_DRIVER_NOTHING || rig_value(&rig, "sticks", 16) == 1000.0);
    }
    rig_close(&rig);
    (void)close(line.master);
}

static void check_split_sbus(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_sbus, line.name) == FCSL_DRIVER_OK);
    begin_sbus(&rig, &line);
    for (size_t first = 1; first < SBUS_BYTES; first++) {
        CHECK(serial_rig_read_parts(&rig, (serial_parts_t){&line, SBUS, SBUS_BYTES, first, 0}) == FCSL_DRIVER_OK);
        CHECK(has_steps(&rig, SBUS_STEPS));
    }
    for (size_t i = 0; i < 6; i++) { /* an adapter's pieces, which end anywhere, with pauses */
        static const size_t SIZES[] = {12, 12, 12, 14};
        uint8_t bytes[2 * SBUS_BYTES];
        memcpy(bytes, SBUS, SBUS_BYTES);
        memcpy(bytes + SBUS_BYTES, SBUS, SBUS_BYTES);
        size_t at = 0;
        int samples = 0;
        for (size_t piece = 0; piece < 4; piece++) {
            pause_line();
            serial_rig_send(&line, bytes + at, SIZES[piece]);
            at += SIZES[piece];
            samples += rig_read(&rig) == FCSL_DRIVER_OK;
        }
        CHECK(samples == 2);
    }
    rig_close(&rig);
    (void)close(line.master);
}

/* Bytes before and behind; a frame that ends too early; and two frames at once, of which the last one counts. */
static void check_damaged_sbus(void)
{
    static rig_t rig;
    uint8_t two[2 * SBUS_BYTES];
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_sbus, line.name) == FCSL_DRIVER_OK);
    memcpy(two, SBUS, SBUS_BYTES);
    memcpy(two + SBUS_BYTES, SBUS, SBUS_BYTES);
    serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
    serial_rig_send(&line, two, sizeof two);
    serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && has_steps(&rig, SBUS_STEPS));
    serial_rig_send(&line, SBUS, SBUS_BYTES - 1);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    serial_rig_send(&line, SBUS, SBUS_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING);
    memcpy(two + SBUS_BYTES, SBUS, SBUS_BYTES);
    two[SBUS_BYTES + FLAGS] = 0x08;
    serial_rig_send(&line, two, sizeof two);
    int samples = 0;
    while (rig_read(&rig) == FCSL_DRIVER_OK) { /* the system may hand them out one by one */
        samples++;
    }
    CHECK(samples >= 1 && samples <= 2 && rig_value(&rig, "failsafe", 0) == 1.0);
    rig_close(&rig);
    (void)close(line.master);
}

/* ---- CRSF --------------------------------------------------------------------------------------------------------------- */

static void check_crsf(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_crsf, line.name) == FCSL_DRIVER_OK);
    CHECK(serial_rig_mode(&line).c_ospeed == 420000u && (serial_rig_mode(&line).c_cflag & CSTOPB) == 0u);
    serial_rig_send(&line, CRSF, CRSF_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && has_steps(&rig, CRSF_STEPS) && rig_value(&rig, "failsafe", 0) == 0.0);
    CHECK(isnan(rig_value(&rig, "sticks", 16)) && isnan(rig_value(&rig, "sticks", 17)));
    CHECK(isnan(rig_value(&rig, "rssi", 0)) && isnan(rig_value(&rig, "link_quality", 0)));
    serial_rig_send(&line, LINK, LINK_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_NOTHING && isnan(rig_value(&rig, "rssi", 0)));
    serial_rig_send(&line, CRSF, CRSF_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK);
    CHECK(rig_value(&rig, "rssi", 0) == -45.0 && rig_value(&rig, "link_quality", 0) == 1.0);
    rig_close(&rig);
    (void)close(line.master);
}

static void check_crsf_failsafe(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_crsf, line.name) == FCSL_DRIVER_OK);
    serial_rig_send(&line, LINK_LOST, LINK_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "failsafe", 0) == 1.0);
    CHECK(rig_value(&rig, "link_quality", 0) == 0.0 && rig_value(&rig, "rssi", 0) == -120.0);
    CHECK(isnan(rig_value(&rig, "sticks", 0)));
    serial_rig_send(&line, CRSF, CRSF_BYTES); /* values that the receiver makes up */
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "failsafe", 0) == 1.0);
    serial_rig_send(&line, LINK, LINK_BYTES);
    serial_rig_send(&line, CRSF, CRSF_BYTES);
    CHECK(rig_read(&rig) == FCSL_DRIVER_OK && rig_value(&rig, "failsafe", 0) == 0.0);
    rig_close(&rig);
    (void)close(line.master);
}

static void check_split_crsf(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, &fcsl_driver_crsf, line.name) == FCSL_DRIVER_OK);
    for (size_t first = 1; first < CRSF_BYTES; first++) {
        serial_rig_send(&line, GARBAGE, sizeof GARBAGE);
        CHECK(serial_rig_read_parts(&rig, (serial_parts_t){&line, CRSF, CRSF_BYTES, first, 0}) == FCSL_DRIVER_OK);
        CHECK(has_steps(&rig, CRSF_STEPS));
    }
    rig_close(&rig);
    (void)close(line.master);
}

int main(void)
{
    serial_rig_check_names(&fcsl_driver_sbus);
    serial_rig_check_life(&fcsl_driver_sbus);
    serial_rig_check_life(&fcsl_driver_crsf);
    check_sbus();
    check_sbus_flags();
    check_split_sbus();
    check_damaged_sbus();
    check_crsf();
    check_crsf_failsafe();
    check_split_crsf();
    return 0;
}
