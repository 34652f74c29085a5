/* SPDX-License-Identifier: Apache-2.0
 *
 * Hardware I/O of a board, used by the builtins hw_read_gpio, hw_write_gpio, hw_read_adc, hw_read_u32 and hw_write_u32 of
 * algorithms. A board provides one table. The host passes it to step (fcsl_host_t.hw). Without a table, reads return false
 * or 0 and writes have no effect. Devices with a protocol or a timer (PWM, counters, sensors) belong into drivers
 * (fcsl_driver.h).
 */
#ifndef FCSL_HW_H
#define FCSL_HW_H

#include <stdbool.h>

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Every function gets `ctx` and is called from step. It must not allocate, wait or keep a pointer. It returns 0 on success,
 * or another value if the pin, channel or register does not exist or the hardware failed. After a failure a read gives false
 * or 0, whatever it stored; the step continues, and the host counts the failure. A null function means that the board lacks
 * this hardware. */
struct fcsl_hw {
    void *ctx;
    int32_t (*read_gpio)(void *ctx, uint32_t pin, bool *level);
    int32_t (*write_gpio)(void *ctx, uint32_t pin, bool level);
    int32_t (*read_adc)(void *ctx, uint32_t channel, uint32_t *counts); /* raw value of the converter */
    int32_t (*read_u32)(void *ctx, uint32_t address, uint32_t *value);  /* a register or port; the board defines */
    int32_t (*write_u32)(void *ctx, uint32_t address, uint32_t value);  /* the meaning of `address` */
};

/* A board library (`fcsl-fc --board libboard.so`) exports these two functions. The first is called before the first tick
 * and returns the table, or null with the reason in `error`. The second is called after the last tick and sets the outputs
 * to a safe state. */
#define FCSL_BOARD_OPEN  "fcsl_board_open"
#define FCSL_BOARD_CLOSE "fcsl_board_close"
typedef const struct fcsl_hw *fcsl_board_open_fn(char *error, size_t error_size);
typedef void fcsl_board_close_fn(const struct fcsl_hw *hw);

/* Called by generated code. `host` may be null. */

static inline bool fcsl_hw_read_gpio(const fcsl_host_t *host, uint32_t pin)
{
    bool level = false;
    if (host == NULL || host->hw == NULL || host->hw->read_gpio == NULL ||
        host->hw->read_gpio(host->hw->ctx, pin, &level) != 0) {
        return false;
    }
    return level;
}

static inline void fcsl_hw_write_gpio(const fcsl_host_t *host, uint32_t pin, bool level)
{
    if (host != NULL && host->hw != NULL && host->hw->write_gpio != NULL) {
        (void)host->hw->write_gpio(host->hw->ctx, pin, level);
    }
}

static inline uint32_t fcsl_hw_read_adc(const fcsl_host_t *host, uint32_t channel)
{
    uint32_t counts = 0;
    if (host == NULL || host->hw == NULL || host->hw->read_adc == NULL ||
        host->hw->read_adc(host->hw->ctx, channel, &counts) != 0) {
        return 0;
    }
    return counts;
}

static inline uint32_t fcsl_hw_read_u32(const fcsl_host_t *host, uint32_t address)
{
    uint32_t value = 0;
    if (host == NULL || host->hw == NULL || host->hw->read_u32 == NULL ||
        host->hw->read_u32(host->hw->ctx, address, &value) != 0) {
        return 0;
    }
    return value;
}

static inline void fcsl_hw_write_u32(const fcsl_host_t *host, uint32_t address, uint32_t value)
{
    if (host != NULL && host->hw != NULL && host->hw->write_u32 != NULL) {
        (void)host->hw->write_u32(host->hw->ctx, address, value);
    }
}

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HW_H */
