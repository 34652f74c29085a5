/* SPDX-License-Identifier: Apache-2.0
 *
 * MAVLink 2 with its common messages that hold these values as f32: HIGHRES_IMU and ATTITUDE_QUATERNION, and
 * HIL_ACTUATOR_CONTROLS. What else they hold is 0. The tick stands where their time does.
 */
#include "mavlink_uart.h"

#include "common/mavlink.h"

static size_t encode(direction_t direction, const values_t *values, uint8_t bytes[MESSAGE_MAX])
{
    uart_begin(bytes);
    if (direction == SENSORS) {
        const mavlink_highres_imu_t imu = {
            .time_usec = values->tick,
            .xacc = values->accelerometer[0],
            .yacc = values->accelerometer[1],
            .zacc = values->accelerometer[2],
            .xgyro = values->gyroscope[0],
            .ygyro = values->gyroscope[1],
            .zgyro = values->gyroscope[2],
            .fields_updated = 0x3f,
        };
        const mavlink_attitude_quaternion_t attitude = {
            .time_boot_ms = (uint32_t)values->tick,
            .q1 = values->attitude[0],
            .q2 = values->attitude[1],
            .q3 = values->attitude[2],
            .q4 = values->attitude[3],
        };
        mavlink_msg_highres_imu_send_struct(MAVLINK_COMM_0, &imu);
        mavlink_msg_attitude_quaternion_send_struct(MAVLINK_COMM_0, &attitude);
    } else {
        mavlink_hil_actuator_controls_t controls = {
            .time_usec = values->tick,
            .mode = values->armed ? MAV_MODE_FLAG_SAFETY_ARMED : 0,
        };
        memcpy(controls.controls, values->motors, sizeof values->motors);
        mavlink_msg_hil_actuator_controls_send_struct(MAVLINK_COMM_0, &controls);
    }
    return uart_size();
}

/* The values of a message; true when it completes those of a direction. A tick's IMU comes before its attitude. */
static int take(direction_t direction, const mavlink_message_t *message, values_t *values)
{
    if (direction == SENSORS && message->msgid == MAVLINK_MSG_ID_HIGHRES_IMU) {
        mavlink_highres_imu_t imu;
        mavlink_msg_highres_imu_decode(message, &imu);
        values->tick = imu.time_usec;
        values->accelerometer[0] = imu.xacc;
        values->accelerometer[1] = imu.yacc;
        values->accelerometer[2] = imu.zacc;
        values->gyroscope[0] = imu.xgyro;
        values->gyroscope[1] = imu.ygyro;
        values->gyroscope[2] = imu.zgyro;
        return 0;
    }
    if (direction == SENSORS && message->msgid == MAVLINK_MSG_ID_ATTITUDE_QUATERNION) {
        mavlink_attitude_quaternion_t attitude;
        mavlink_msg_attitude_quaternion_decode(message, &attitude);
        values->attitude[0] = attitude.q1;
        values->attitude[1] = attitude.q2;
        values->attitude[2] = attitude.q3;
        values->attitude[3] = attitude.q4;
        return (uint32_t)values->tick == attitude.time_boot_ms;
    }
    if (direction == ACTUATORS && message->msgid == MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS) {
        mavlink_hil_actuator_controls_t controls;
        mavlink_msg_hil_actuator_controls_decode(message, &controls);
        values->tick = controls.time_usec;
        values->armed = (controls.mode & MAV_MODE_FLAG_SAFETY_ARMED) != 0;
        memcpy(values->motors, controls.controls, sizeof values->motors);
        return 1;
    }
    return 0;
}

#include "mavlink_decode.h"

const format_t MAVLINK_STANDARD = {"MAVLink 2, standard messages", 1, encode, decode, reset};
