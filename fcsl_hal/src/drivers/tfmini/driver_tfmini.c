/* SPDX-License-Identifier: Apache-2.0
 *
 * The driver `tfmini`: a range finder on a serial device. The time of a sample is that at which the last byte of its frame was read.
 */
#include "fcsl/fcsl_driver.h"

#include <math.h>
#include <unistd.h>

#include "serial/serial.h"
#include "tfmini.h"

static const serial_mode_t MODE = {.baud = 115200};

typedef struct {
    double distance;
    double strength;
    double temperature;
    fcsl_driver_input_t input;
    int fd;
    tfmini_t parser;
} range_finder_t;

static const fcsl_driver_signal_t signals[] = {
    FCSL_DRIVER_SIGNAL(range_finder_t, distance, "m", "NaN: the echo is too weak or too strong, or there is none"),
    FCSL_DRIVER_SIGNAL(range_finder_t, strength, "", "of the echo: 0 to 65535, which is overexposed"),
    FCSL_DRIVER_SIGNAL(range_finder_t, temperature, "degC", "of the chip"),
};

static fcsl_driver_status_t open_range_finder(void *self, const char *device, const uint8_t *used, char *why,
                                              size_t size)
{
    (void)used;
    range_finder_t *finder = self;
    finder->distance = (double)NAN;
    return serial_open(device, &MODE, &finder->fd, why, size);
}

static int take(void *self, const uint8_t *bytes, uint32_t count, uint64_t time_ns, uint64_t *sample_ns)
{
    range_finder_t *finder = self;
    tfmini_reading_t reading;
    int found = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (tfmini_take(&finder->parser, bytes[i], &reading) != 0) {
            finder->distance = reading.is_reliable ? reading.distance_cm / 100.0 : (double)NAN;
            finder->strength = reading.strength;
            finder->temperature = reading.temperature_degc;
            *sample_ns = time_ns;
            found = 1;
        }
    }
    return found;
}

static fcsl_driver_status_t read_range_finder(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    range_finder_t *finder = self;
    const fcsl_driver_status_t status = serial_sample(finder->fd, take, finder, &finder->input, sample_ns, why, size);
    byte_stream_report(&finder->parser.stream, &finder->input);
    return status;
}

static void close_range_finder(void *self)
{
    (void)close(((range_finder_t *)self)->fd);
}

const fcsl_driver_t fcsl_driver_tfmini = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "tfmini",
    .doc = "range finder TFmini Plus, TFmini-S or TF-Luna, tfmini:DEVICE[:BAUD]; 115200 baud, standard format in cm",
    .direction = FCSL_SENSOR,
    .signals = signals,
    .signal_count = sizeof signals / sizeof signals[0],
    .state_size = sizeof(range_finder_t),
    .state_align = _Alignof(range_finder_t),
    .waits = 1,
    .input = offsetof(range_finder_t, input),
    .probe = serial_probe,
    .open = open_range_finder,
    .read = read_range_finder,
    .close = close_range_finder,
};
