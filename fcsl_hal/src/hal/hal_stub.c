/* SPDX-License-Identifier: Apache-2.0
 *
 * The stub HAL: no sensors, no actuators, the monotonic clock.
 */
#define _GNU_SOURCE
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_hal.h"

static uint64_t now_ns(void *ctx)
{
    (void)ctx;
    return fcsl_monotonic_ns();
}

static void wait(void *ctx, uint64_t until_ns)
{
    (void)ctx;
    fcsl_monotonic_wait(until_ns);
}

const fcsl_clock_t fcsl_monotonic_clock = {.now_ns = now_ns, .wait = wait};

static int stub_open(fcsl_hal_t *hal, fcsl_error_t *error)
{
    (void)hal;
    (void)error;
    return 0;
}

static fcsl_hal_status_t stub_sample(void *ctx, uint64_t tick, const fcsl_sink_t *to)
{
    (void)ctx;
    (void)tick;
    (void)to;
    return FCSL_HAL_OK;
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
        .clock = fcsl_monotonic_clock,
        .log = log,
        .count = stub_nothing,
        .explain = stub_explain,
        .alive = stub_nothing,
        .interrupt = stub_nothing,
        .close = free,
    };
    return 0;
}
