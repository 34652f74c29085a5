/* SPDX-License-Identifier: Apache-2.0
 *
 * Hardware I/O of a board: what the builtins hw_read_gpio, hw_write_gpio, hw_read_adc, hw_write_pwm and hw_read_counter of
 * an algorithm reach. A board offers one table; whoever hosts the machine hands it to step (fcsl_host_t.hw). A machine
 * without a table, as in a test that puts no hardware in, reads false and 0 and writes nothing.
 */
#ifndef FCSL_HW_H
#define FCSL_HW_H

#include <stdbool.h>

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Every function gets `ctx`, is called from the step and must not allocate, wait or keep a pointer. It returns 0, or any
 * other value when there is no such pin or channel or the hardware failed: a read then gives false or 0 whatever it
 * stored, the step goes on, and the host counts the failure. A null function is hardware that the board lacks. */
struct fcsl_hw {
    void *ctx;
    int32_t (*read_gpio)(void *ctx, int32_t pin, bool *level);
    int32_t (*write_gpio)(void *ctx, int32_t pin, bool level);
    int32_t (*read_adc)(void *ctx, int32_t channel, double *volts);
    int32_t (*write_pwm)(void *ctx, int32_t channel, double duty); /* 0 to 1 */
    int32_t (*read_counter)(void *ctx, int32_t channel, int64_t *count);
};

/* A board as a shared library (`fcsl-fc --board libboard.so`) exports these two functions. The first is called before the
 * first tick and returns the table, or null with the reason in `error`; the second after the last tick, to leave the
 * outputs safe. */
#define FCSL_BOARD_OPEN  "fcsl_board_open"
#define FCSL_BOARD_CLOSE "fcsl_board_close"
typedef const struct fcsl_hw *fcsl_board_open_fn(char *error, size_t error_size);
typedef void fcsl_board_close_fn(const struct fcsl_hw *hw);

/* What generated code calls; `host` may be null. */

static inline bool fcsl_hw_read_gpio(const fcsl_host_t *host, int32_t pin)
{
    bool level = false;
    if (host == NULL || host->hw == NULL || host->hw->read_gpio == NULL ||
        host->hw->read_gpio(host->hw->ctx, pin, &level) != 0) {
        return false;
    }
    return level;
}

static inline void fcsl_hw_write_gpio(const fcsl_host_t *host, int32_t pin, bool level)
{
    if (host != NULL && host->hw != NULL && host->hw->write_gpio != NULL) {
        (void)host->hw->write_gpio(host->hw->ctx, pin, level);
    }
}

static inline double fcsl_hw_read_adc(const fcsl_host_t *host, int32_t channel)
{
    double volts = 0.0;
    if (host == NULL || host->hw == NULL || host->hw->read_adc == NULL ||
        host->hw->read_adc(host->hw->ctx, channel, &volts) != 0) {
        return 0.0;
    }
    return volts;
}

static inline void fcsl_hw_write_pwm(const fcsl_host_t *host, int32_t channel, double duty)
{
    if (host != NULL && host->hw != NULL && host->hw->write_pwm != NULL) {
        (void)host->hw->write_pwm(host->hw->ctx, channel, duty);
    }
}

static inline int64_t fcsl_hw_read_counter(const fcsl_host_t *host, int32_t channel)
{
    int64_t count = 0;
    if (host == NULL || host->hw == NULL || host->hw->read_counter == NULL ||
        host->hw->read_counter(host->hw->ctx, channel, &count) != 0) {
        return 0;
    }
    return count;
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HW_H */
