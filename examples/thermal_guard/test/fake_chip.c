/* SPDX-License-Identifier: Apache-2.0
 *
 * A GPIO chip in place of the kernel's: linked before board/gpiochip.c with open, ioctl and close wrapped. Lines 0 to 31
 * exist; line 5 is in use by somebody else; line 4 reads high. What was asked goes to stdout.
 */
#include <linux/gpio.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fcsl/fcsl_hw.h>

/* Ends the program with the place and the text of a condition that does not hold. */
#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            (void)fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);                       \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

enum { CHIP = 1000, FIRST_LINE = 2000 };

fcsl_board_open_fn fcsl_board_open;
fcsl_board_close_fn fcsl_board_close;

int __wrap_open(const char *path, int flags, ...);
int __wrap_close(int file);
int __wrap_ioctl(int file, unsigned long request, ...);

int __wrap_open(const char *path, int flags, ...)
{
    (void)flags;
    (void)printf("open %s\n", path);
    return CHIP;
}

int __wrap_close(int file)
{
    (void)printf("close %d\n", file);
    return 0;
}

int __wrap_ioctl(int file, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (request == GPIO_V2_GET_LINE_IOCTL) {
        struct gpio_v2_line_request *line = data;
        CHECK(file == CHIP && line->num_lines == 1 && strcmp(line->consumer, "fcsl") == 0);
        const unsigned number = line->offsets[0];
        (void)printf("claim %u %s\n", number, line->config.flags == GPIO_V2_LINE_FLAG_OUTPUT ? "output" : "input");
        line->fd = FIRST_LINE + (int)number;
        return number > 31 || number == 5 ? -1 : 0;
    }
    struct gpio_v2_line_values *values = data;
    CHECK(file >= FIRST_LINE && values->mask == 1);
    if (request == GPIO_V2_LINE_SET_VALUES_IOCTL) {
        (void)printf("line %d %d\n", file - FIRST_LINE, (int)values->bits);
    } else {
        CHECK(request == GPIO_V2_LINE_GET_VALUES_IOCTL);
        values->bits = file - FIRST_LINE == 4;
    }
    return 0;
}

int main(void)
{
    char error[64] = "";
    bool level = false;
    const struct fcsl_hw *hw = fcsl_board_open(error, sizeof error);
    CHECK(hw != NULL && hw->read_adc == NULL && hw->read_u32 == NULL && hw->write_u32 == NULL);
    CHECK(hw->write_gpio(hw->ctx, 17, true) == 0 && hw->write_gpio(hw->ctx, 17, false) == 0);
    CHECK(hw->write_gpio(hw->ctx, 17, true) == 0);
    CHECK(hw->read_gpio(hw->ctx, 4, &level) == 0 && level);
    CHECK(hw->read_gpio(hw->ctx, 3, &level) == 0 && !level);
    /* Taken by another program, not on the chip, not a number of a line, claimed for the other direction. */
    CHECK(hw->write_gpio(hw->ctx, 5, true) != 0 && hw->write_gpio(hw->ctx, 32, true) != 0);
    CHECK(hw->write_gpio(hw->ctx, UINT32_MAX, true) != 0 && hw->write_gpio(hw->ctx, 64, true) != 0);
    CHECK(hw->write_gpio(hw->ctx, 4, true) != 0 && hw->read_gpio(hw->ctx, 17, &level) != 0);
    fcsl_board_close(hw);
    return 0;
}
