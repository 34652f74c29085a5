/* SPDX-License-Identifier: Apache-2.0
 *
 * The controller of vehicle.json as an engineer would write it by hand in C: one struct, a function per block, a step that
 * calls what is due. The same logic and the same tunable parameters, without instances, health bookkeeping, faults or
 * connections. For `make bench`.
 */
#ifndef VEHICLE_BY_HAND_H
#define VEHICLE_BY_HAND_H

#include <stdbool.h>
#include <stdint.h>

typedef enum { HAND_HOLD, HAND_MISSION, HAND_LANDING } hand_state_t;

typedef struct {
    double kp, ki, kd, limit, smooth;
    double integral, before, slope;
    double torque;
} rate_loop_t;

typedef struct {
    double position, velocity;
} axis_t;

typedef struct {
    uint64_t tick;
    hand_state_t state;
    /* sensors */
    double gyro[3], accel[3];
    double gps_position[3], gps_velocity[3], gps_accuracy;
    double baro, sticks[4], mode, voltage;
    /* parameters */
    double gyro_gain, accel_gain, baro_gain, voltage_gain;
    double attitude_kp, attitude_ki;
    double altitude_q, altitude_r;
    double alpha, beta, worst_accuracy;
    double waypoints[4][3], speed, reach;
    double hold_speed;
    double landing_gain, landing_slowest, landing_fastest;
    double velocity_kp, velocity_ki, velocity_limit;
    double hover;
    double attitude_gain[3], yaw_rate;
    double share[4][3];
    double slew;
    double radius;
    double empty;
    /* what the blocks keep and give */
    double gyro_filtered[3], accel_filtered[3], baro_filtered, voltage_filtered;
    double q[4], rate[3], world_accel[3], bias[3];
    double altitude, climb, p00, p01, p11;
    axis_t north, east;
    bool gps_lost;
    uint32_t waypoint;
    double wanted_velocity[3];
    double velocity_integral[3], wanted_accel[3];
    double thrust, wanted_q[4];
    double wanted_rate[3];
    rate_loop_t loops[3];
    double mixed[4], motors[4];
    double distance;
    bool is_low;
} vehicle_by_hand_t;

void vehicle_by_hand_init(vehicle_by_hand_t *v);
/* One tick of 1 ms; the commands are in v->motors. */
void vehicle_by_hand_step(vehicle_by_hand_t *v);

#endif /* VEHICLE_BY_HAND_H */
