/* SPDX-License-Identifier: Apache-2.0
 *
 * A board library as a user writes one: the ADC reads 1500 counts, the LED's level and what is written to registers go to the
 * file $FCSL_TEST_BOARD; registers cannot be read.
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_hw.h"

static FILE *file;

static int32_t write_gpio(void *ctx, uint32_t pin, bool level)
{
    return fprintf(ctx, "%u %d\n", (unsigned)pin, (int)level) > 0 ? 0 : -1;
}

static int32_t read_adc(void *ctx, uint32_t channel, uint32_t *counts)
{
    (void)ctx;
    *counts = channel == 3 ? 1500 : 99;
    return channel == 3 ? 0 : -1;
}

static int32_t write_u32(void *ctx, uint32_t address, uint32_t value)
{
    return fprintf(ctx, "0x%x %u\n", (unsigned)address, (unsigned)value) > 0 ? 0 : -1;
}

static struct fcsl_hw hw = {.write_gpio = write_gpio, .read_adc = read_adc, .write_u32 = write_u32};

fcsl_board_open_fn fcsl_board_open;
fcsl_board_close_fn fcsl_board_close;

const struct fcsl_hw *fcsl_board_open(char *error, size_t error_size)
{
    const char *path = getenv("FCSL_TEST_BOARD");
    file = path != NULL ? fopen(path, "w") : NULL;
    if (file == NULL) {
        (void)snprintf(error, error_size, "no GPIO chip");
        return NULL;
    }
    hw.ctx = file;
    return &hw;
}

void fcsl_board_close(const struct fcsl_hw *opened)
{
    (void)fprintf(opened->ctx, "safe\n");
    (void)fclose(file);
}
