/* SPDX-License-Identifier: Apache-2.0
 *
 * The stub HAL: a clock, a log, and no sensors.
 */
#include <string.h>

#include "fcsl/fcsl_hal.h"
#include "fcsl_check.h"

enum { MESSAGE_BYTES = 64, TEXT_BYTES = 512 };

static void test_stub(void)
{
    uint8_t bytes[MESSAGE_BYTES] = {0};
    fcsl_message_t message = {.bytes = bytes, .size = 8};
    char line[FCSL_LOG_BYTES];
    fcsl_error_t error;
    fcsl_hal_t hal;
    CHECK(fcsl_hal_stub(&hal, &error) == 0 && hal.open(&hal, &error) == 0);
    const uint64_t soon_ns = hal.clock.now_ns(hal.clock.ctx) + 1000000u;
    hal.clock.wait(hal.clock.ctx, soon_ns);
    CHECK(hal.clock.now_ns(hal.clock.ctx) >= soon_ns);
    CHECK(hal.arm(hal.ctx, 1) == FCSL_HAL_OK && hal.arm(hal.ctx, 0) == FCSL_HAL_OK);
    CHECK(!fcsl_log_read(hal.log, line));
    fcsl_log_write(hal.log, "armed");
    CHECK(fcsl_log_read(hal.log, line) && strcmp(line, "armed") == 0 && !fcsl_log_read(hal.log, line));
    CHECK(hal.sample(hal.ctx, 0, NULL) == FCSL_HAL_OK);
    CHECK(hal.command(hal.ctx, &message) == FCSL_HAL_OK);
    CHECK(!hal.paces && !hal.serves);
    hal.interrupt(hal.ctx);
    hal.close(hal.ctx);
}

/* What finds no room is told behind what found some. */
static void test_full_log(void)
{
    enum { LOST = 3 };
    char line[FCSL_LOG_BYTES];
    fcsl_error_t error;
    fcsl_hal_t hal;
    CHECK(fcsl_hal_stub(&hal, &error) == 0);
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < FCSL_LOG_LINES + LOST; i++) {
            (void)snprintf(line, sizeof line, "line %d", i);
            fcsl_log_write(hal.log, line);
        }
        for (int i = 0; i < FCSL_LOG_LINES; i++) {
            char expected[FCSL_LOG_BYTES];
            (void)snprintf(expected, sizeof expected, "line %d", i);
            CHECK(fcsl_log_read(hal.log, line) && strcmp(line, expected) == 0);
        }
        CHECK(fcsl_log_read(hal.log, line) && strncmp(line, "3 lines were not printed", 24) == 0);
        CHECK(!fcsl_log_read(hal.log, line));
    }
    hal.close(hal.ctx);
}

int main(void)
{
    test_stub();
    test_full_log();
    return 0;
}
