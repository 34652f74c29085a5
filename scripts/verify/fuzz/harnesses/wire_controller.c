/* SPDX-License-Identifier: Apache-2.0
 *
 * hal_wire.c, the controller's end of a wire: messages from a simulator or rig that sends anything. Input: operations (1 byte
 * each, some with an argument); a message is of any bytes, or is made for a tick near the one that is due.
 */
#include "hal_wire.c"

#include "channel_fixture.h"
#include "fcsl/fcsl_scalar.h"
#include "fake_wire.h"

enum { OP_RAW, OP_SENSORS, OP_TIME, OP_CONTROL, OP_COMMAND, OP_CLOSE, OP_COUNT, ROOM = 1024 };

typedef struct {
    const hal_t *hal;
    uint64_t tick;
    int count;
} sink_t;

static void sensed(void *ctx, const fcsl_message_t *message)
{
    sink_t *sink = ctx;
    fcsl_message_t again;
    FUZZ_CHECK(message->tick == sink->tick && sink->count++ == 0);
    FUZZ_CHECK(fcsl_message_check(&sink->hal->table, FCSL_SENSOR_MESSAGE, message->bytes, message->size, &again) ==
               FCSL_MESSAGE_OK);
}

/* What a sample promises. */
static void sample(hal_t *hal, uint64_t *tick)
{
    sink_t sink = {.hal = hal, .tick = *tick};
    const fcsl_sink_t to = {.ctx = &sink, .sensed = sensed};
    fcsl_hal_status_t status = FCSL_HAL_WAITING;
    while (status == FCSL_HAL_WAITING) {
        status = wire_sample(hal, *tick, &to);
    }
    FUZZ_CHECK(status == FCSL_HAL_OK || (wire_explain(hal)[0] != '\0' && sink.count == 0));
    FUZZ_CHECK(hal->paces || status == FCSL_HAL_OK); /* a rig ends nothing */
    *tick += status == FCSL_HAL_OK;
}

static size_t made_message(const hal_t *hal, bytes_t *bytes, uint64_t tick, int is_time, uint8_t *out)
{
    data_t data;
    uint8_t select[CHANNEL_COUNT];
    fcsl_message_t made;
    memset(&data, 0, sizeof data);
    const uint64_t chosen = take_number(bytes, 2);
    for (uint32_t i = 0; i < CHANNEL_COUNT; i++) {
        select[i] = (uint8_t)(chosen >> i & 1u);
    }
    const uint64_t at = tick + take_number(bytes, 1) % 4u - 1u;
    const fcsl_message_status_t status =
        is_time ? fcsl_message_encode_time(&hal->table, at, chosen, out, ROOM, &made)
                : fcsl_message_encode_sensors(&hal->table, &data, at, select, out, ROOM, &made);
    FUZZ_CHECK(status == FCSL_MESSAGE_OK);
    return made.size;
}

static void command(hal_t *hal, uint64_t tick)
{
    static const data_t ZERO;
    uint8_t out[ROOM];
    fcsl_message_t made;
    FUZZ_CHECK(fcsl_message_encode_actuators(&hal->table, &ZERO, tick, 1, out, sizeof out, &made) == FCSL_MESSAGE_OK);
    const fcsl_hal_status_t status = wire_command(hal, &made);
    FUZZ_CHECK(status == FCSL_HAL_OK || (hal->paces && wire_explain(hal)[0] != '\0'));
}

static void run_operations(hal_t *hal, fake_wire_t *fake, bytes_t *bytes)
{
    uint64_t tick = 1;
    while (bytes->left > 0) {
        const uint64_t op = take_number(bytes, 1) % OP_COUNT;
        uint8_t made[ROOM];
        if (op == OP_RAW) {
            size_t length = (size_t)take_number(bytes, 1) * 4u;
            uint8_t *packet = take_copy(bytes, &length);
            fake_put(fake, packet, length);
            free(packet);
        } else if (op == OP_SENSORS || op == OP_TIME) {
            fake_put(fake, made, made_message(hal, bytes, tick, op == OP_TIME, made));
        } else if (op == OP_CONTROL) {
            fake_put_control(fake, bytes, &hal->table);
        } else if (op == OP_COMMAND) {
            command(hal, tick);
        } else {
            fake->closed = 1;
        }
        sample(hal, &tick);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fake_wire_t fake = {0};
    fcsl_error_t error = {""};
    fcsl_hal_t handle;
    const fcsl_wire_t wire = fake_wire(&fake);
    FUZZ_CHECK(fcsl_hal_over_wire(&wire, &MACHINE, 0, &handle, &error) == 0);
    hal_t *hal = handle.ctx;
    fake_put_control(&fake, &bytes, &hal->table);
    /* A handshake that fails says why; the HAL is then used as if it had not. */
    fake.ends = 1;
    FUZZ_CHECK(shake_hands(hal, UINT64_MAX, &error) == 0 || error.text[0] != '\0');
    fake.ends = 0;
    run_operations(hal, &fake, &bytes);
    handle.close(handle.ctx);
    return 0;
}
