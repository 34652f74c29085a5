/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `ubx` and `nmea`: receivers of satellite navigation on a serial device. The receiver is not configured.
 *
 * The time of a sample is that at which the first byte of the solution was read, the moment closest to the epoch. The receiver's own
 * delay, from the epoch to this byte, is not known (tens of milliseconds are usual), and not subtracted.
 */
#include "fcsl/fcsl_driver.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include "gnss.h"
#include "serial/serial.h"

static const serial_mode_t UBX_MODE = {.baud = 38400};
static const serial_mode_t NMEA_MODE = {.baud = 9600};
static const double DEGREE = 3.14159265358979323846 / 180.0;

typedef struct {
    double fix;
    double latitude;
    double longitude;
    double altitude;
    double height;
    double velocity[3];
    double satellites;
    double horizontal_accuracy;
    double vertical_accuracy;
    double speed_accuracy;
    fcsl_driver_input_t input;
    int fd;
    gnss_ubx_t ubx; /* of the driver ubx */
    gnss_nmea_t nmea; /* of the driver nmea */
    uint64_t solution_ns; /* nmea: of its first sentence */
    uint64_t byte_ns[BYTE_STREAM_MAX]; /* when the last bytes were read, by their number */
    uint64_t bytes; /* so many were read */
} gnss_t;

/* Their places. NMEA tells none of the accuracies, and of the velocity only what is horizontal. */
enum { VELOCITY = 5, HORIZONTAL_ACCURACY = 7, SPEED_ACCURACY = 9 };
static const fcsl_driver_signal_t signals[] = {
    FCSL_DRIVER_SIGNAL(gnss_t, fix, "", "0: none, 2: 2D, 3: 3D; without a fix all but the satellites is NaN"),
    FCSL_DRIVER_SIGNAL(gnss_t, latitude, "deg", "north"),
    FCSL_DRIVER_SIGNAL(gnss_t, longitude, "deg", "east"),
    FCSL_DRIVER_SIGNAL(gnss_t, altitude, "m", "above mean sea level"),
    FCSL_DRIVER_SIGNAL(gnss_t, height, "m", "above the ellipsoid"),
    FCSL_DRIVER_SIGNAL(gnss_t, velocity, "m/s", "north, east, down; NMEA tells no down, and no course at rest (NaN)"),
    FCSL_DRIVER_SIGNAL(gnss_t, satellites, "", "used for the solution"),
    FCSL_DRIVER_SIGNAL(gnss_t, horizontal_accuracy, "m", "standard deviation; NaN with NMEA"),
    FCSL_DRIVER_SIGNAL(gnss_t, vertical_accuracy, "m", "standard deviation; NaN with NMEA"),
    FCSL_DRIVER_SIGNAL(gnss_t, speed_accuracy, "m/s", "standard deviation; NaN with NMEA"),
};

static void put_fix(gnss_t *gnss, const gnss_fix_t *solution)
{
    const gnss_fix_t none = gnss_no_fix();
    const gnss_fix_t *fix = solution->kind != GNSS_NO_FIX ? solution : &none;
    gnss->fix = (double)fix->kind;
    gnss->satellites = solution->satellites;
    gnss->latitude = fix->latitude_deg;
    gnss->longitude = fix->longitude_deg;
    gnss->altitude = fix->altitude_m;
    gnss->height = fix->height_m;
    gnss->horizontal_accuracy = (double)fix->horizontal_m;
    gnss->vertical_accuracy = (double)fix->vertical_m;
    gnss->speed_accuracy = (double)fix->speed_mps;
    for (uint32_t i = 0; i < 3u; i++) {
        gnss->velocity[i] = (double)fix->velocity_ned_mps[i];
    }
}

/* The number of a byte and its time go together; the parser holds the last ones. */
static void count_byte(gnss_t *gnss, uint64_t time_ns)
{
    gnss->byte_ns[gnss->bytes % BYTE_STREAM_MAX] = time_ns;
    gnss->bytes++;
}

/* When the first byte that the parser holds was read: the first one of the frame that is complete. */
static uint64_t first_byte_ns(const gnss_t *gnss, const byte_stream_t *stream)
{
    return gnss->byte_ns[(gnss->bytes - stream->size) % BYTE_STREAM_MAX];
}

static void close_gnss(void *self)
{
    (void)close(((gnss_t *)self)->fd);
}

/* ---- UBX ---------------------------------------------------------------------------------------------------------------- */

static fcsl_driver_status_t open_ubx(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    (void)used;
    return serial_open(device, &UBX_MODE, &((gnss_t *)self)->fd, why, size);
}

static int take_ubx(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns)
{
    gnss_t *gnss = self;
    gnss_fix_t fix;
    int found = 0;
    for (uint32_t i = 0; i < count; i++) {
        count_byte(gnss, time_ns);
        if (gnss_ubx_take(&gnss->ubx, bytes[i], &fix) != 0) {
            put_fix(gnss, &fix);
            *sample_ns = first_byte_ns(gnss, &gnss->ubx.stream);
            found = 1;
        }
    }
    return found;
}

static fcsl_driver_status_t read_ubx(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    gnss_t *gnss = self;
    const fcsl_driver_status_t status = serial_sample(gnss->fd, take_ubx, gnss, &gnss->input, sample_ns, why, size);
    byte_stream_report(&gnss->ubx.stream, &gnss->input);
    return status;
}

const fcsl_driver_t fcsl_driver_ubx = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "ubx",
    .doc =
        "u-blox GNSS receiver, ubx:DEVICE[:BAUD]; 38400 baud. UBX-NAV-PVT must be enabled on this port of the receiver",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = sizeof signals / sizeof signals[0],
    .state_size = sizeof(gnss_t),
    .state_align = _Alignof(gnss_t),
    .waits = 1,
    .input = offsetof(gnss_t, input),
    .probe = serial_probe,
    .open = open_ubx,
    .read = read_ubx,
    .close = close_gnss,
};

/* ---- NMEA --------------------------------------------------------------------------------------------------------------- */

static fcsl_driver_status_t open_nmea(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    for (uint32_t i = 0; i < sizeof signals / sizeof signals[0]; i++) {
        const int is_untold = i == VELOCITY || (i >= HORIZONTAL_ACCURACY && i <= SPEED_ACCURACY);
        if (is_untold && used[i] == FCSL_DRIVER_NEEDED) {
            (void)snprintf(why, size, "%s is needed, and NMEA does not tell %s", signals[i].name,
                           i == VELOCITY ? "how fast it goes down" : "it");
            return FCSL_DRIVER_FAILED;
        }
    }
    return serial_open(device, &NMEA_MODE, &((gnss_t *)self)->fd, why, size);
}

/* NMEA tells the motion as speed and course. */
static void put_motion(gnss_t *gnss, const gnss_fix_t *fix)
{
    if (fix->kind == GNSS_NO_FIX) {
        return;
    }
    const double course = (double)fix->course_deg * DEGREE;
    gnss->velocity[0] = (double)fix->ground_speed_mps * cos(course);
    gnss->velocity[1] = (double)fix->ground_speed_mps * sin(course);
}

static int take_nmea(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns)
{
    gnss_t *gnss = self;
    gnss_nmea_t *nmea = &gnss->nmea;
    gnss_fix_t fix;
    int found = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t seen = nmea->seen;
        const int64_t ns_of_day = nmea->ns_of_day;
        count_byte(gnss, time_ns);
        if (gnss_nmea_take(nmea, bytes[i], &fix) != 0) {
            put_fix(gnss, &fix);
            put_motion(gnss, &fix);
            *sample_ns = gnss->solution_ns;
            found = 1;
        } else if (nmea->seen != 0u && (seen == 0u || ns_of_day != nmea->ns_of_day)) { /* the first sentence */
            gnss->solution_ns = first_byte_ns(gnss, &nmea->stream);
        }
    }
    return found;
}

static fcsl_driver_status_t read_nmea(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    gnss_t *gnss = self;
    const fcsl_driver_status_t status = serial_sample(gnss->fd, take_nmea, gnss, &gnss->input, sample_ns, why, size);
    byte_stream_report(&gnss->nmea.stream, &gnss->input);
    return status;
}

const fcsl_driver_t fcsl_driver_nmea = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "nmea",
    .doc = "GNSS receiver with NMEA 0183, nmea:DEVICE[:BAUD]; 9600 baud. It must send GGA and RMC, of any talker",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = sizeof signals / sizeof signals[0],
    .state_size = sizeof(gnss_t),
    .state_align = _Alignof(gnss_t),
    .waits = 1,
    .input = offsetof(gnss_t, input),
    .probe = serial_probe,
    .open = open_nmea,
    .read = read_nmea,
    .close = close_gnss,
};
