/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `tfmini` on a pseudo terminal, with frames whose fields are those of Benewake's manuals.
 */
#define _GNU_SOURCE
#include <math.h>

#include "drivers.h"
#include "serial_rig.h"

enum { FRAME_BYTES = 9 };

static const fcsl_driver_t *const driver = &fcsl_driver_tfmini;

/* 1.21 m, strength 1000, 25 degC: (25 + 256) * 8 is 0x08C8. */
static const uint8_t FRAME[FRAME_BYTES] = {0x59, 0x59, 0x79, 0x00, 0xE8, 0x03, 0xC8, 0x08, 0xE6};

static void make_frame(uint8_t frame[FRAME_BYTES], uint32_t distance_cm, uint32_t strength)
{
    memcpy(frame, FRAME, FRAME_BYTES);
    frame[2] = (uint8_t)distance_cm;
    frame[3] = (uint8_t)(distance_cm >> 8);
    frame[4] = (uint8_t)strength;
    frame[5] = (uint8_t)(strength >> 8);
    frame[8] = 0;
    for (int i = 0; i < FRAME_BYTES - 1; i++) {
        frame[8] = (uint8_t)(frame[8] + frame[i]);
    }
}

static int reads(rig_t *rig, const serial_rig_t *line, const void *bytes, size_t size, double distance)
{
    serial_rig_send(line, bytes, size);
    if (rig_read(rig) != FCSL_DRIVER_OK) {
        return 0;
    }
    const double read = rig_value(rig, "distance", 0);
    return isnan(distance) ? isnan(read) : read == distance;
}

static void check_values(void)
{
    static rig_t rig;
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, driver, line.name) == FCSL_DRIVER_OK);
    CHECK(serial_rig_mode(&line).c_ospeed == 115200u && isnan(rig_value(&rig, "distance", 0)));
    const uint64_t before_ns = fcsl_monotonic_ns();
    CHECK(reads(&rig, &line, FRAME, sizeof FRAME, 1.21));
    CHECK(rig.sample_ns > before_ns && rig.sample_ns <= fcsl_monotonic_ns());
    CHECK(rig_value(&rig, "strength", 0) == 1000.0 && rig_value(&rig, "temperature", 0) == 25.0);
    rig_close(&rig);
    (void)close(line.master);
}

/* A frame without a distance is a sample: the device lives, and tells how strong the echo is. */
static void check_unreliable(void)
{
    static rig_t rig;
    static const struct {
        uint32_t distance_cm;
        uint32_t strength;
        double distance;
    } CASES[] = {{800, 100, 8.0},  {800, 99, NAN},      {800, 65535, NAN}, {800, 65534, 8.0}, {0, 30000, NAN},
                 {65535, 50, NAN}, {65534, 65535, NAN}, {65532, 200, NAN}, {1, 200, 0.01},    {0x5959, 0x5959, 228.73}};
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, driver, line.name) == FCSL_DRIVER_OK);
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        uint8_t frame[FRAME_BYTES];
        make_frame(frame, CASES[i].distance_cm, CASES[i].strength);
        CHECK(reads(&rig, &line, frame, sizeof frame, CASES[i].distance));
        CHECK(rig_value(&rig, "strength", 0) == CASES[i].strength);
    }
    rig_close(&rig);
    (void)close(line.master);
}

/* Of several frames that come at once the last one is the sample; a damaged one is none. */
static void check_stream(void)
{
    static rig_t rig;
    uint8_t bytes[3 * FRAME_BYTES];
    const serial_rig_t line = serial_rig_open();
    CHECK(rig_open(&rig, driver, line.name) == FCSL_DRIVER_OK);
    for (size_t first = 1; first < FRAME_BYTES; first++) {
        CHECK(serial_rig_read_parts(&rig, (serial_parts_t){&line, FRAME, FRAME_BYTES, first, 0}) == FCSL_DRIVER_OK);
        CHECK(rig_value(&rig, "distance", 0) == 1.21);
    }
    memcpy(bytes, FRAME, FRAME_BYTES);
    make_frame(bytes + FRAME_BYTES, 250, 500);
    make_frame(bytes + 2 * FRAME_BYTES, 900, 500);
    bytes[sizeof bytes - 1]++;
    CHECK(reads(&rig, &line, bytes, sizeof bytes, 2.5));
    CHECK(reads(&rig, &line, FRAME, sizeof FRAME, 1.21));
    rig_close(&rig);
    (void)close(line.master);
}

int main(void)
{
    check_values();
    check_unreliable();
    check_stream();
    serial_rig_check_names(driver);
    serial_rig_check_life(driver);
    return 0;
}
