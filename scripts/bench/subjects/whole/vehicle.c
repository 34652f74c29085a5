/* SPDX-License-Identifier: Apache-2.0 */
#include "vehicle_by_hand.h"
#include "whole.h"

#define BOTH(field, path, count, mean, spread) {path, offsetof(vehicle_by_hand_t, field), count, mean, spread}

const whole_link_t by_hand_sensors[] = {
    BOTH(gyro, "imu.outputs.gyro", 3, 0.0, 0.05),
    BOTH(accel, "imu.outputs.accel", 3, 5.0, 0.8),
    BOTH(gps_position, "gps.outputs.position", 3, 10.0, 1.0),
    BOTH(gps_velocity, "gps.outputs.velocity", 3, 0.5, 0.1),
    BOTH(gps_accuracy, "gps.outputs.accuracy", 1, 1.5, 0.5),
    BOTH(baro, "baro.outputs.altitude", 1, 20.0, 0.5),
    BOTH(sticks, "receiver.outputs.sticks", 4, 0.0, 0.2),
    BOTH(mode, "receiver.outputs.mode", 1, 0.0, 0.1),
    BOTH(voltage, "battery.outputs.voltage", 1, 15.0, 0.1),
};
const size_t by_hand_sensor_count = sizeof by_hand_sensors / sizeof *by_hand_sensors;

const whole_link_t by_hand_results[] = {
    BOTH(motors[0], "motor0.outputs.command", 1, 0.0, 0.0),
    BOTH(motors[1], "motor1.outputs.command", 1, 0.0, 0.0),
    BOTH(motors[2], "motor2.outputs.command", 1, 0.0, 0.0),
    BOTH(motors[3], "motor3.outputs.command", 1, 0.0, 0.0),
    BOTH(q, "attitude.outputs.q", 4, 0.0, 0.0),
    BOTH(altitude, "altitude.outputs.altitude", 1, 0.0, 0.0),
    BOTH(distance, "geofence.outputs.distance", 1, 0.0, 0.0),
};
const size_t by_hand_result_count = sizeof by_hand_results / sizeof *by_hand_results;
const size_t by_hand_size = sizeof(vehicle_by_hand_t);

void by_hand_init(void *by_hand)
{
    vehicle_by_hand_init(by_hand);
}

void by_hand_step(void *by_hand)
{
    vehicle_by_hand_step(by_hand);
}
