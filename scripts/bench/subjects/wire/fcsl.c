/* SPDX-License-Identifier: Apache-2.0
 *
 * FCSL's messages of channels: alone, and in frames of a link on a serial line.
 */
#include "wire.h"

#include <fcsl/fcsl_cobs.h>
#include <fcsl/fcsl_codec.h>
#include <fcsl/fcsl_link.h>
#include <string.h>

enum { PORT = 1 };

/* The struct of a machine that has these channels. */
typedef struct {
    float accelerometer[3];
    float gyroscope[3];
    float attitude[4];
    float motors[4];
    uint32_t age[3];
    int64_t stamp[3];
    uint8_t fresh[3];
} machine_t;

#define F32(path_, member_, count_)                                                                                    \
    {.path = (path_),                                                                                                  \
     .role = FCSL_ROLE_OUTPUT,                                                                                         \
     .type = FCSL_F32,                                                                                                 \
     .rank = 1,                                                                                                        \
     .shape = (const uint32_t[]){count_},                                                                              \
     .count = (count_),                                                                                                \
     .offset = offsetof(machine_t, member_),                                                                           \
     .size = 4 * (count_)}
#define SAMPLED(name_, id_, field_, as_)                                                                               \
    {.name = (name_),                                                                                                  \
     .id = (id_),                                                                                                      \
     .direction = FCSL_SENSOR,                                                                                         \
     .field = (field_),                                                                                                \
     .fresh_offset = (uint32_t)offsetof(machine_t, fresh) + (field_),                                                  \
     .sample_age_offset = (uint32_t)offsetof(machine_t, age) + 4u * (field_),                                          \
     .stamp_offset = (uint32_t)offsetof(machine_t, stamp) + 8u * (field_),                                             \
     .as = (as_)}

static const fcsl_field_t FIELDS[] = {F32("imu.accelerometer", accelerometer, 3), F32("imu.gyroscope", gyroscope, 3),
                                      F32("ahrs.attitude", attitude, 4), F32("mixer.motors", motors, 4)};
static const fcsl_channel_t CHANNELS[] = {
    SAMPLED("accelerometer", 1, 0, FCSL_AS_FIELD),
    SAMPLED("gyroscope", 2, 1, FCSL_AS_FIELD),
    SAMPLED("attitude", 3, 2, FCSL_AS_QUATERNION),
    {.name = "motors", .id = 16, .direction = FCSL_ACTUATOR, .field = 3},
};
static const fcsl_machine_t MACHINE = {
    .abi_version = FCSL_ABI_VERSION,
    .name = "quadcopter",
    .tick_hz = 1000,
    .size = sizeof(machine_t),
    .align = _Alignof(machine_t),
    .fields = FIELDS,
    .field_count = sizeof FIELDS / sizeof FIELDS[0],
    .channels = CHANNELS,
    .channel_count = sizeof CHANNELS / sizeof CHANNELS[0],
};

static const fcsl_message_kind_t KIND[DIRECTIONS] = {FCSL_SENSOR_MESSAGE, FCSL_ACTUATOR_MESSAGE};

static const fcsl_channel_table_t *table(void)
{
    static fcsl_channel_table_t made;
    if (made.machine == NULL) {
        made = fcsl_channel_table(&MACHINE);
    }
    return &made;
}

static size_t encode(direction_t direction, const values_t *values, uint8_t bytes[MESSAGE_MAX])
{
    static machine_t machine;
    fcsl_message_t message;
    fcsl_message_status_t status = FCSL_MESSAGE_KIND;
    if (direction == SENSORS) {
        memcpy(machine.accelerometer, values->accelerometer, sizeof machine.accelerometer);
        memcpy(machine.gyroscope, values->gyroscope, sizeof machine.gyroscope);
        memcpy(machine.attitude, values->attitude, sizeof machine.attitude);
        status = fcsl_message_encode_sensors(table(), &machine, values->tick, NULL, bytes, MESSAGE_MAX, &message);
    } else {
        memcpy(machine.motors, values->motors, sizeof machine.motors);
        status =
            fcsl_message_encode_actuators(table(), &machine, values->tick, values->armed, bytes, MESSAGE_MAX, &message);
    }
    return status == FCSL_MESSAGE_OK ? message.size : 0;
}

/* The values of a message; true when it is one of this direction. */
static int take(direction_t direction, const uint8_t *bytes, size_t size, values_t *values)
{
    static machine_t machine;
    fcsl_message_t message;
    if (fcsl_message_check(table(), KIND[direction], bytes, size, &message) != FCSL_MESSAGE_OK) {
        return 0;
    }
    fcsl_message_apply(&MACHINE, &machine, &message);
    values->tick = message.tick;
    if (direction == SENSORS) {
        memcpy(values->accelerometer, machine.accelerometer, sizeof machine.accelerometer);
        memcpy(values->gyroscope, machine.gyroscope, sizeof machine.gyroscope);
        memcpy(values->attitude, machine.attitude, sizeof machine.attitude);
    } else {
        memcpy(values->motors, machine.motors, sizeof machine.motors);
        values->armed = message.armed;
    }
    return 1;
}

static size_t decode(direction_t direction, const uint8_t *bytes, size_t size, values_t *values, int *accepted)
{
    *accepted = take(direction, bytes, size, values);
    return size;
}

static void reset(void)
{
}

const format_t FCSL_MESSAGE = {"FCSL, message", 0, encode, decode, reset};

/* ---- on a serial line --------------------------------------------------------------------------------------------- */

static fcsl_link_t sender;
static fcsl_link_t receiver;
static fcsl_cobs_decoder_t decoder;

/* What the ends have to say in a tick. */
static void exchange(fcsl_link_t *from, fcsl_link_t *to)
{
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size = 0;
    fcsl_link_tick(from);
    while ((size = fcsl_link_next_frame(from, frame)) > 0) {
        fcsl_link_take_frame(to, frame, size);
    }
}

/* Two ends that know each other, as most of the time. */
static void serial_reset(void)
{
    const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = FCSL_LINK_LATEST};
    (void)fcsl_link_open(&sender, policies, 1, 1);
    (void)fcsl_link_open(&receiver, policies, 2, 1);
    decoder = (fcsl_cobs_decoder_t){.size = 0};
    for (int i = 0; i < 4 * FCSL_LINK_HELLO_TICKS; i++) {
        exchange(&sender, &receiver);
        exchange(&receiver, &sender);
    }
}

static size_t serial_encode(direction_t direction, const values_t *values, uint8_t bytes[MESSAGE_MAX])
{
    uint8_t message[MESSAGE_MAX];
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size = encode(direction, values, message);
    size_t count = 0;
    if (fcsl_link_send(&sender, PORT, message, size) != FCSL_LINK_OK) {
        return 0;
    }
    fcsl_link_tick(&sender);
    while ((size = fcsl_link_next_frame(&sender, frame)) > 0) {
        count += fcsl_cobs_encode(frame, size, bytes + count);
    }
    return count;
}

static size_t serial_decode(direction_t direction, const uint8_t *bytes, size_t size, values_t *values, int *accepted)
{
    uint8_t message[MESSAGE_MAX];
    size_t found = 0;
    for (size_t at = 0; at < size;) {
        size_t frame = 0;
        at += fcsl_cobs_decode(&decoder, bytes + at, size - at, &frame);
        if (frame > 0) {
            fcsl_link_take_frame(&receiver, decoder.frame, frame);
        }
        if (frame > 0 && fcsl_link_receive(&receiver, PORT, message, sizeof message, &found) == FCSL_LINK_OK &&
            take(direction, message, found, values)) {
            *accepted = 1;
            return at;
        }
    }
    *accepted = 0;
    return size;
}

const format_t FCSL_SERIAL = {"FCSL, serial line", 1, serial_encode, serial_decode, serial_reset};
