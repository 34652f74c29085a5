/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines of a GPIO chip of the kernel, by its character device (Documentation/userspace-api/gpio of the kernel). An address is
 * `CHIP[,OPTION…]`: the chip by its file, its name or its label; and what all its lines are.
 */
#ifndef FCSL_GPIO_CHIP_H
#define FCSL_GPIO_CHIP_H

#include "fcsl/fcsl_driver.h"

enum { GPIO_LINES = 64 };

/* `line0` to `line63`, in a struct that begins with their values. */
extern const fcsl_driver_signal_t gpio_signals[GPIO_LINES];

/* Whether the chip is there and the options are known; `outputs`: of lines that are driven. */
fcsl_driver_status_t gpio_probe(const char *device, int outputs, char *why, size_t size);

/* Whether the chip has the used lines, and nobody else uses them. Optional lines that it lacks, that are in use or driven become unused:
 * they are for people who look, and to claim a line is to make it an input. Claims nothing. */
fcsl_driver_status_t gpio_check(const char *device, int outputs, uint8_t *used, char *why, size_t size);

/* Checks and claims the used lines; those that are driven get these values at once. ABSENT: there is no such chip. */
fcsl_driver_status_t gpio_claim(const char *device, int outputs, uint8_t *used, const double *values, int *file,
                                char *why, size_t size);

/* Of claimed lines, in the places of the used ones. ABSENT: the chip has gone. */
fcsl_driver_status_t gpio_get(int file, const uint8_t *used, double *values, char *why, size_t size);
fcsl_driver_status_t gpio_set(int file, const uint8_t *used, const double *values, char *why, size_t size);

#endif /* FCSL_GPIO_CHIP_H */
