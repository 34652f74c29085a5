/* SPDX-License-Identifier: Apache-2.0
 *
 * The stub HAL: no sensors, no actuators, the monotonic clock.
 */
#define _GNU_SOURCE
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_hal.h"

static int stub_open(fcsl_hal_t *hal, fcsl_error_t *error)
{
    (void)hal;
    (void)error;
    return 0;
}

static fcsl_hal_status_t stub_sample(void *ctx, uint64_t tick, uint8_t *bytes, size_t capacity, fcsl_message_t *message)
{
    (void)ctx;
    (void)tick;
    (void)bytes;
    (void)capacity;
    (void)message;
    return FCSL_HAL_NONE;
}

static fcsl_hal_status_t stub_command(void *ctx, const fcsl_message_t *message)
{
    (void)ctx;
    (void)message;
    return FCSL_HAL_OK;
}

static fcsl_hal_status_t stub_arm(void *ctx, int armed)
{
    (void)ctx;
    (void)armed;
    return FCSL_HAL_OK;
}

static uint64_t stub_now_ns(void *ctx)
{
    (void)ctx;
    return fcsl_monotonic_ns();
}

static void stub_wait(void *ctx, uint64_t until_ns)
{
    (void)ctx;
    fcsl_monotonic_wait(until_ns);
}

/* All that there is of it. */
static void stub_log(void *ctx, const char *text)
{
    fcsl_log_write(ctx, text);
}

static int stub_read_log(void *ctx, char text[FCSL_LOG_BYTES])
{
    return fcsl_log_read(ctx, text);
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

int fcsl_hal_stub(fcsl_hal_t *hal, fcsl_error_t *error)
{
    fcsl_log_t *log = calloc(1, sizeof *log);
    if (log == NULL) {
        return fcsl_fail(error, "out of memory for the HAL");
    }
    *hal = (fcsl_hal_t){
        .ctx = log,
        .open = stub_open,
        .sample = stub_sample,
        .command = stub_command,
        .arm = stub_arm,
        .now_ns = stub_now_ns,
        .wait = stub_wait,
        .log = stub_log,
        .read_log = stub_read_log,
        .count = stub_nothing,
        .explain = stub_explain,
        .alive = stub_nothing,
        .interrupt = stub_nothing,
        .close = free,
    };
    return 0;
}
