/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers `gpio`, which polls lines of a GPIO chip, and `gpio_out`, which drives them.
 */
#define _GNU_SOURCE
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_monotonic.h"

#include "fcsl/fcsl_driver.h"
#include "gpio_chip.h"

static const uint64_t RECHECK_NS = 100000000u; /* for a chip that has gone */

typedef struct {
    double lines[GPIO_LINES]; /* the signals */
    uint8_t used[GPIO_LINES];
    const char *device;
    int file; /* -1: no line is claimed */
    uint64_t poll_ns; /* outputs: when a chip that has gone is looked for */
} gpio_t;

static void keep(gpio_t *gpio, const char *device, const uint8_t *used)
{
    memcpy(gpio->used, used, sizeof gpio->used);
    gpio->device = device;
    gpio->file = -1;
}

static void close_gpio(void *self)
{
    const gpio_t *gpio = self;
    if (gpio->file >= 0) {
        (void)close(gpio->file);
    }
}

/* ---- inputs ------------------------------------------------------------------------------------------------------------- */

static fcsl_driver_status_t probe_inputs(const char *device, char *why, size_t size)
{
    return gpio_probe(device, 0, why, size);
}

static fcsl_driver_status_t open_inputs(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    gpio_t *gpio = self;
    keep(gpio, device, used);
    const fcsl_driver_status_t status = gpio_claim(device, 0, gpio->used, NULL, &gpio->file, why, size);
    for (uint32_t i = 0; i < GPIO_LINES; i++) {
        gpio->lines[i] = gpio->used[i] != FCSL_DRIVER_UNUSED ? 0.0 : NAN;
    }
    return status;
}

static fcsl_driver_status_t read_inputs(void *self, uint64_t *sample_ns, char *why, size_t size)
{
    gpio_t *gpio = self;
    const uint64_t begin_ns = fcsl_monotonic_ns();
    const fcsl_driver_status_t status = gpio_get(gpio->file, gpio->used, gpio->lines, why, size);
    if (status == FCSL_DRIVER_OK) {
        *sample_ns = begin_ns;
    }
    return status;
}

const fcsl_driver_t fcsl_driver_gpio = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "gpio",
    .doc = "lines of a GPIO chip, polled; gpio:CHIP[,active_low][,pull_up|,pull_down], its file or its label",
    .direction = FCSL_SENSOR,
    .signals = gpio_signals,
    .signal_count = GPIO_LINES,
    .state_size = sizeof(gpio_t),
    .state_align = _Alignof(gpio_t),
    .waits = 0,
    .probe = probe_inputs,
    .open = open_inputs,
    .read = read_inputs,
    .close = close_gpio,
};

/* ---- outputs ------------------------------------------------------------------------------------------------------------ */

static fcsl_driver_status_t probe_outputs(const char *device, char *why, size_t size)
{
    return gpio_probe(device, 1, why, size);
}

/* The first write claims the lines: to claim one is to drive it. */
static fcsl_driver_status_t open_outputs(void *self, const char *device, const uint8_t *used, char *why, size_t size)
{
    gpio_t *gpio = self;
    keep(gpio, device, used);
    return gpio_check(device, 1, gpio->used, why, size);
}

static fcsl_driver_status_t claim_outputs(gpio_t *gpio, char *why, size_t size)
{
    const uint64_t now_ns = fcsl_monotonic_ns();
    if (now_ns < gpio->poll_ns) {
        (void)snprintf(why, size, "the GPIO chip '%.100s' has gone", gpio->device);
        return FCSL_DRIVER_FAILED;
    }
    gpio->poll_ns = now_ns + RECHECK_NS;
    const fcsl_driver_status_t status = gpio_claim(gpio->device, 1, gpio->used, gpio->lines, &gpio->file, why, size);
    return status == FCSL_DRIVER_OK ? status : FCSL_DRIVER_FAILED;
}

static fcsl_driver_status_t write_outputs(void *self, char *why, size_t size)
{
    gpio_t *gpio = self;
    if (gpio->file < 0) {
        return claim_outputs(gpio, why, size);
    }
    const fcsl_driver_status_t status = gpio_set(gpio->file, gpio->used, gpio->lines, why, size);
    if (status == FCSL_DRIVER_ABSENT) {
        (void)close(gpio->file);
        gpio->file = -1;
        return FCSL_DRIVER_FAILED;
    }
    return status;
}

const fcsl_driver_t fcsl_driver_gpio_out = {
    .abi_version = FCSL_DRIVER_ABI_VERSION,
    .name = "gpio_out",
    .doc = "lines of a GPIO chip, driven; gpio_out:CHIP[,active_low][,open_drain|,open_source], its file or its label",
    .direction = FCSL_ACTUATOR,
    .signals = gpio_signals,
    .signal_count = GPIO_LINES,
    .state_size = sizeof(gpio_t),
    .state_align = _Alignof(gpio_t),
    .probe = probe_outputs,
    .open = open_outputs,
    .write = write_outputs,
    .close = close_gpio,
};
