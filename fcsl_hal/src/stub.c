/* SPDX-License-Identifier: Apache-2.0
 *
 * The stub HAL: no sensors, no actuators, ticks as fast as the host asks.
 */
#include "fcsl/fcsl_hal.h"

static fcsl_hal_status_t stub_sample(void *ctx, uint64_t tick, uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    (void)ctx;
    (void)tick;
    (void)bytes;
    (void)capacity;
    (void)message;
    return FCSL_HAL_NONE;
}

static fcsl_hal_status_t stub_actuate(void *ctx, const fcsl_message_t *message)
{
    (void)ctx;
    (void)message;
    return FCSL_HAL_OK;
}

static const char *stub_explain(void *ctx)
{
    (void)ctx;
    return "";
}

static void stub_nothing(void *ctx)
{
    (void)ctx;
}

fcsl_hal_t fcsl_hal_stub(void)
{
    const fcsl_hal_t hal = {
        .ctx = NULL,
        .sample = stub_sample,
        .actuate = stub_actuate,
        .explain = stub_explain,
        .interrupt = stub_nothing,
        .close = stub_nothing,
        .serves = 0,
        .paces = 0,
    };
    return hal;
}
