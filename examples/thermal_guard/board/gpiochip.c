/* SPDX-License-Identifier: Apache-2.0
 *
 * A board library for `fcsl-fc --board`: the digital pins of a Linux computer, through its GPIO character device. The pins
 * are the lines of one chip, $FCSL_GPIOCHIP or /dev/gpiochip0. A line is claimed when it is first used and from then on is
 * an input or an output; released, it falls back to what the kernel makes of a free line.
 */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <fcsl/fcsl_hw.h>

enum { LINES_MAX = 64 };

typedef struct {
    int file; /* -1: not claimed */
    uint64_t flags;
} line_t;

typedef struct {
    int file;
    line_t lines[LINES_MAX];
} chip_t;

static chip_t chip;

/* The claimed line of a pin, or null when there is no such line, it is in use, or it serves the other direction. */
static const line_t *claim(chip_t *on, uint32_t pin, uint64_t flags)
{
    if (pin >= LINES_MAX) {
        return NULL;
    }
    line_t *line = &on->lines[pin];
    if (line->file < 0) {
        struct gpio_v2_line_request request;
        memset(&request, 0, sizeof request);
        request.offsets[0] = pin;
        request.num_lines = 1;
        request.config.flags = flags;
        (void)snprintf(request.consumer, sizeof request.consumer, "fcsl");
        if (ioctl(on->file, GPIO_V2_GET_LINE_IOCTL, &request) < 0) {
            return NULL;
        }
        *line = (line_t){.file = request.fd, .flags = flags};
    }
    return line->flags == flags ? line : NULL;
}

static int32_t read_gpio(void *ctx, uint32_t pin, bool *level)
{
    const line_t *line = claim(ctx, pin, GPIO_V2_LINE_FLAG_INPUT);
    struct gpio_v2_line_values values = {.mask = 1};
    if (line == NULL || ioctl(line->file, GPIO_V2_LINE_GET_VALUES_IOCTL, &values) < 0) {
        return -1;
    }
    *level = (values.bits & 1u) != 0;
    return 0;
}

static int32_t write_gpio(void *ctx, uint32_t pin, bool level)
{
    const line_t *line = claim(ctx, pin, GPIO_V2_LINE_FLAG_OUTPUT);
    struct gpio_v2_line_values values = {.bits = level, .mask = 1};
    return line != NULL && ioctl(line->file, GPIO_V2_LINE_SET_VALUES_IOCTL, &values) >= 0 ? 0 : -1;
}

/* No ADC and no registers: the host counts what an algorithm tries. */
static const struct fcsl_hw hw = {.ctx = &chip, .read_gpio = read_gpio, .write_gpio = write_gpio};

const struct fcsl_hw *fcsl_board_open(char *error, size_t error_size)
{
    const char *path = getenv("FCSL_GPIOCHIP") != NULL ? getenv("FCSL_GPIOCHIP") : "/dev/gpiochip0";
    for (int i = 0; i < LINES_MAX; i++) {
        chip.lines[i].file = -1;
    }
    chip.file = open(path, O_RDWR | O_CLOEXEC);
    if (chip.file < 0) {
        (void)snprintf(error, error_size, "cannot open %s: %s", path, strerror(errno));
        return NULL;
    }
    return &hw;
}

void fcsl_board_close(const struct fcsl_hw *opened)
{
    for (uint32_t i = 0; i < LINES_MAX; i++) {
        if (chip.lines[i].file >= 0) {
            if (chip.lines[i].flags == GPIO_V2_LINE_FLAG_OUTPUT) {
                (void)write_gpio(opened->ctx, i, false);
            }
            (void)close(chip.lines[i].file);
        }
    }
    (void)close(chip.file);
}
