/* SPDX-License-Identifier: Apache-2.0
 *
 * MAVLink 2 with the dialect of peers/mavlink/bench.xml: one message a direction, with exactly these fields.
 */
#include "mavlink_uart.h"

#include "bench/mavlink.h"

static size_t encode(direction_t direction, const values_t *values, uint8_t bytes[MESSAGE_MAX])
{
    uart_begin(bytes);
    if (direction == SENSORS) {
        mavlink_bench_sensors_t packet = {.tick = values->tick};
        memcpy(packet.accelerometer, values->accelerometer, sizeof packet.accelerometer);
        memcpy(packet.gyroscope, values->gyroscope, sizeof packet.gyroscope);
        memcpy(packet.attitude, values->attitude, sizeof packet.attitude);
        mavlink_msg_bench_sensors_send_struct(MAVLINK_COMM_0, &packet);
    } else {
        mavlink_bench_actuators_t packet = {.tick = values->tick, .armed = values->armed};
        memcpy(packet.motors, values->motors, sizeof packet.motors);
        mavlink_msg_bench_actuators_send_struct(MAVLINK_COMM_0, &packet);
    }
    return uart_size();
}

/* The values of a message, if it is one of this direction. */
static int take(direction_t direction, const mavlink_message_t *message, values_t *values)
{
    if (direction == SENSORS && message->msgid == MAVLINK_MSG_ID_BENCH_SENSORS) {
        mavlink_bench_sensors_t packet;
        mavlink_msg_bench_sensors_decode(message, &packet);
        values->tick = packet.tick;
        memcpy(values->accelerometer, packet.accelerometer, sizeof packet.accelerometer);
        memcpy(values->gyroscope, packet.gyroscope, sizeof packet.gyroscope);
        memcpy(values->attitude, packet.attitude, sizeof packet.attitude);
        return 1;
    }
    if (direction == ACTUATORS && message->msgid == MAVLINK_MSG_ID_BENCH_ACTUATORS) {
        mavlink_bench_actuators_t packet;
        mavlink_msg_bench_actuators_decode(message, &packet);
        values->tick = packet.tick;
        values->armed = packet.armed;
        memcpy(values->motors, packet.motors, sizeof packet.motors);
        return 1;
    }
    return 0;
}

#include "mavlink_decode.h"

const format_t MAVLINK_OWN = {"MAVLink 2, own dialect", 1, encode, decode, reset};
