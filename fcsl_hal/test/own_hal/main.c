/* SPDX-License-Identifier: Apache-2.0
 *
 * A host of a few lines with the HAL of docs/hardware/hal.md, which is included here: command = 0.5 * measurement + 1, looped back, goes
 * to 2.
 */
#include LOOPBACK_HAL

#include <math.h>
#include <stddef.h>

#include "fcsl_check.h"

typedef struct {
    double measurement;
    double command;
    int64_t stamp_ns;
    uint32_t sample_age;
    uint8_t fresh;
} data_t;

static const fcsl_field_t FIELDS[] = {
    {.path = "measurement", .type = FCSL_F64, .count = 1, .offset = offsetof(data_t, measurement), .size = 8},
    {.path = "command", .type = FCSL_F64, .count = 1, .offset = offsetof(data_t, command), .size = 8},
};
static const fcsl_channel_t CHANNELS[] = {
    {.name = "measurement",
     .id = 1,
     .direction = FCSL_SENSOR,
     .field = 0,
     .attached_offset = FCSL_NO_OFFSET,
     .fresh_offset = offsetof(data_t, fresh),
     .valid_offset = FCSL_NO_OFFSET,
     .waiting_offset = FCSL_NO_OFFSET,
     .age_offset = FCSL_NO_OFFSET,
     .sample_age_offset = offsetof(data_t, sample_age),
     .stamp_offset = offsetof(data_t, stamp_ns)},
    {.name = "command", .id = 2, .direction = FCSL_ACTUATOR, .field = 1},
};
static const fcsl_machine_t MACHINE = {.tick_hz = 100,
                                       .size = sizeof(data_t),
                                       .fields = FIELDS,
                                       .field_count = 2,
                                       .channels = CHANNELS,
                                       .channel_count = 2};

enum { TICKS = 60, ROOM = 512 };

static void sensed(void *ctx, const fcsl_message_t *message)
{
    fcsl_message_apply(&MACHINE, ctx, message);
}

int main(void)
{
    static loopback_t loopback;
    data_t data = {0};
    data_t channels = {0};
    uint8_t select[2] = {0};
    uint8_t bytes[ROOM];
    fcsl_error_t error;
    fcsl_message_t message;
    fcsl_hal_t hal;
    const fcsl_sink_t to = {.ctx = &data, .sensed = sensed};
    const fcsl_channel_table_t table = fcsl_channel_table(&MACHINE);
    CHECK(loopback_hal(&loopback, &MACHINE, &channels, select, &hal) == 0);
    CHECK(hal.open(&hal, &error) == 0);
    for (uint64_t tick = 0; tick < TICKS; tick++) {
        data.fresh = 0;
        CHECK(hal.sample(hal.ctx, tick, &to) == FCSL_HAL_OK && data.fresh == (tick > 0));
        data.command = 0.5 * data.measurement + 1.0;
        CHECK(fcsl_message_encode_actuators(&table, &data, tick, 1, bytes, sizeof bytes, &message) == FCSL_MESSAGE_OK);
        CHECK(hal.command(hal.ctx, &message) == FCSL_HAL_OK);
    }
    hal.close(hal.ctx);
    uint64_t commands = 0;
    memcpy(&commands, (const char *)hal.counters + hal.fields[0].offset, sizeof commands);
    CHECK(commands == TICKS && fabs(data.command - 2.0) < 1e-12);
    return 0;
}
