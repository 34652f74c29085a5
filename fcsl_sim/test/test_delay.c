/* SPDX-License-Identifier: Apache-2.0
 *
 * The delay of commands: each acts once, so many ticks after its own, also where ticks have none.
 */
#include <string.h>

#include "check.h"
#include "controllers/delay.h"
#include "hopper.h"

enum { TICKS = 50 };

static fcsl_message_t message_of(const fcsl_channel_table_t *table, uint64_t tick, double throttle, uint8_t *bytes,
                                 size_t capacity)
{
    static hopper_t hopper;
    fcsl_message_t message = {0};
    hopper.i_pilot.outputs.throttle = throttle;
    CHECK(fcsl_message_encode_actuators(table, &hopper, tick, 1, bytes, capacity, &message) == FCSL_MESSAGE_OK);
    return message;
}

/* Whether a tick has a command: all, or all but some. */
static int has_command(uint64_t tick, uint32_t gap)
{
    return gap == 0 || tick % gap != 0;
}

static void acts_once(uint32_t ticks, uint32_t gap)
{
    const fcsl_channel_table_t table = fcsl_channel_table(&hopper_machine);
    const size_t capacity = fcsl_message_capacity(&hopper_machine, FCSL_ACTUATOR_MESSAGE);
    uint8_t bytes[1024];
    fcsl_delay_t delay;
    CHECK(capacity <= sizeof bytes && fcsl_delay_open(&delay, ticks, capacity) == 0);
    for (uint64_t tick = 0; tick < TICKS; tick++) {
        const fcsl_message_t message = message_of(&table, tick, 0.5 + (double)tick, bytes, sizeof bytes);
        fcsl_message_t due = {0};
        const int acts = fcsl_delay_pass(&delay, &table, tick, has_command(tick, gap) ? &message : NULL, &due);
        const int expected = tick >= ticks && has_command(tick - ticks, gap);
        CHECK(acts == expected);
        if (acts) {
            hopper_t hopper = {0};
            CHECK(due.tick == tick - ticks);
            fcsl_message_apply(&hopper_machine, &hopper, &due);
            CHECK(hopper.i_pilot.outputs.throttle == 0.5 + (double)(tick - ticks));
        }
    }
    fcsl_delay_free(&delay);
}

int main(void)
{
    for (uint32_t ticks = 0; ticks < 8; ticks++) {
        for (uint32_t gap = 0; gap < 5; gap++) {
            acts_once(ticks, gap);
        }
    }
    acts_once(1, 1);
    return 0;
}
