/* SPDX-License-Identifier: Apache-2.0
 *
 * A board library as a user writes one: the ADC reads 1.5 V, the LED's level goes to the file $FCSL_TEST_BOARD, there is no
 * counter.
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_hw.h"

static FILE *file;

static int32_t write_gpio(void *ctx, int32_t pin, bool level)
{
    return fprintf(ctx, "%d %d\n", (int)pin, (int)level) > 0 ? 0 : -1;
}

static int32_t read_adc(void *ctx, int32_t channel, double *volts)
{
    (void)ctx;
    *volts = channel == 3 ? 1.5 : 99.0;
    return channel == 3 ? 0 : -1;
}

static int32_t write_pwm(void *ctx, int32_t channel, double duty)
{
    return fprintf(ctx, "pwm %d %g\n", (int)channel, duty) > 0 ? 0 : -1;
}

static struct fcsl_hw hw = {.write_gpio = write_gpio, .read_adc = read_adc, .write_pwm = write_pwm};

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
