/* SPDX-License-Identifier: Apache-2.0 */
#include "vehicle_by_hand.h"

#include <math.h>
#include <string.h>

static const double DT = 1.0 / 1000;
static const double GRAVITY = 9.80665;

static double clamp(double x, double low, double high)
{
    return x < low ? low : high < x ? high : x;
}

static void cross(const double a[3], const double b[3], double result[3])
{
    result[0] = a[1] * b[2] - a[2] * b[1];
    result[1] = a[2] * b[0] - a[0] * b[2];
    result[2] = a[0] * b[1] - a[1] * b[0];
}

static double norm3(const double a[3])
{
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

static void multiply(const double p[4], const double q[4], double result[4])
{
    result[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    result[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    result[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
    result[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
}

static void normalize(double q[4])
{
    const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; ++i) {
        q[i] /= size;
    }
}

static void rotate(const double q[4], const double v[3], double result[3])
{
    double t[3], w[3];
    cross(&q[1], v, t);
    for (int i = 0; i < 3; ++i) {
        t[i] *= 2.0;
    }
    cross(&q[1], t, w);
    for (int i = 0; i < 3; ++i) {
        result[i] = v[i] + q[0] * t[i] + w[i];
    }
}

static void lowpass(double *y, const double *x, double gain, int count)
{
    for (int i = 0; i < count; ++i) {
        y[i] += gain * (x[i] - y[i]);
    }
}

static void estimate_attitude(vehicle_by_hand_t *v)
{
    const double size = norm3(v->accel_filtered);
    double turn[3];
    for (int i = 0; i < 3; ++i) {
        v->rate[i] = v->gyro_filtered[i] - v->bias[i];
        turn[i] = v->rate[i];
    }
    if (size > 1.0) {
        const double up[3] = {0.0, 0.0, 1.0}, back[4] = {v->q[0], -v->q[1], -v->q[2], -v->q[3]};
        double unit[3], up_body[3], error[3];
        for (int i = 0; i < 3; ++i) {
            unit[i] = v->accel_filtered[i] / size;
        }
        rotate(back, up, up_body);
        cross(unit, up_body, error);
        for (int i = 0; i < 3; ++i) {
            v->bias[i] -= error[i] * (v->attitude_ki * DT);
            turn[i] += error[i] * v->attitude_kp;
        }
    }
    const double h = 0.5 * DT, spin[4] = {0.0, turn[0], turn[1], turn[2]};
    double dq[4];
    multiply(v->q, spin, dq);
    for (int i = 0; i < 4; ++i) {
        v->q[i] += h * dq[i];
    }
    normalize(v->q);
    rotate(v->q, v->accel_filtered, v->world_accel);
    v->world_accel[2] -= GRAVITY;
}

static void estimate_altitude(vehicle_by_hand_t *v)
{
    const double dt = 0.004, a = v->world_accel[2];
    v->altitude = v->altitude + dt * v->climb + 0.5 * dt * dt * a;
    v->climb += dt * a;
    const double p00 = v->p00 + 2.0 * dt * v->p01 + dt * dt * v->p11 + v->altitude_q * dt * dt * dt / 3.0;
    const double p01 = v->p01 + dt * v->p11 + v->altitude_q * dt * dt / 2.0;
    const double p11 = v->p11 + v->altitude_q * dt;
    const double s = p00 + v->altitude_r, k0 = p00 / s, k1 = p01 / s;
    const double innovation = v->baro_filtered - v->altitude;
    v->altitude += k0 * innovation;
    v->climb += k1 * innovation;
    v->p00 = (1.0 - k0) * p00;
    v->p01 = (1.0 - k0) * p01;
    v->p11 = p11 - k1 * p01;
}

static void estimate_axis(const vehicle_by_hand_t *v, axis_t *axis, int i)
{
    const double dt = 0.01, a = v->world_accel[i];
    axis->position = axis->position + dt * axis->velocity + 0.5 * dt * dt * a;
    axis->velocity += dt * a;
    if (v->gps_accuracy < v->worst_accuracy) {
        axis->position += v->alpha * (v->gps_position[i] - axis->position);
        axis->velocity += v->beta * (v->gps_velocity[i] - axis->velocity);
    }
}

static void fly_mission(vehicle_by_hand_t *v)
{
    const double *waypoint = v->waypoints[v->waypoint];
    const double to[3] = {waypoint[0] - v->north.position, waypoint[1] - v->east.position, waypoint[2] - v->altitude};
    const double distance = norm3(to);
    if (distance < v->reach) {
        v->waypoint = (v->waypoint + 1u) % 4u;
        memset(v->wanted_velocity, 0, sizeof v->wanted_velocity);
    } else {
        for (int i = 0; i < 3; ++i) {
            v->wanted_velocity[i] = to[i] * (v->speed / distance);
        }
    }
}

static void choose_velocity(vehicle_by_hand_t *v)
{
    switch (v->state) {
    case HAND_MISSION:
        fly_mission(v);
        break;
    case HAND_LANDING:
        v->wanted_velocity[0] = 0.0;
        v->wanted_velocity[1] = 0.0;
        v->wanted_velocity[2] = -clamp(v->landing_gain * v->altitude, v->landing_slowest, v->landing_fastest);
        break;
    case HAND_HOLD:
        for (int i = 0; i < 3; ++i) {
            v->wanted_velocity[i] = v->hold_speed * v->sticks[i];
        }
        break;
    }
}

static void control_velocity(vehicle_by_hand_t *v)
{
    const double is[3] = {v->north.velocity, v->east.velocity, v->climb}, limit = v->velocity_limit;
    for (int i = 0; i < 3; ++i) {
        const double error = v->wanted_velocity[i] - is[i];
        v->velocity_integral[i] = clamp(v->velocity_integral[i] + v->velocity_ki * 0.01 * error, -limit, limit);
        v->wanted_accel[i] = v->velocity_kp * error + v->velocity_integral[i];
    }
}

static void point_thrust(vehicle_by_hand_t *v)
{
    const double force[3] = {v->wanted_accel[0], v->wanted_accel[1], v->wanted_accel[2] + GRAVITY};
    const double size = norm3(force);
    v->thrust = clamp(v->hover * size / GRAVITY, 0.0, 1.0);
    if (size > 0.1) {
        v->wanted_q[0] = 1.0 + force[2] / size;
        v->wanted_q[1] = -(force[1] / size);
        v->wanted_q[2] = force[0] / size;
        v->wanted_q[3] = 0.0;
        normalize(v->wanted_q);
    } else {
        memset(v->wanted_q, 0, sizeof v->wanted_q);
        v->wanted_q[0] = 1.0;
    }
}

static void control_attitude(vehicle_by_hand_t *v)
{
    const double back[4] = {v->q[0], -v->q[1], -v->q[2], -v->q[3]};
    double e[4];
    multiply(back, v->wanted_q, e);
    const double s = e[0] >= 0.0 ? 2.0 : -2.0;
    for (int i = 0; i < 3; ++i) {
        v->wanted_rate[i] = s * v->attitude_gain[i] * e[i + 1];
    }
    v->wanted_rate[2] += v->yaw_rate * v->sticks[3];
}

static void control_rate(rate_loop_t *l, double target, double rate)
{
    const double error = target - rate;
    l->integral = clamp(l->integral + l->ki * DT * error, -l->limit, l->limit);
    l->slope += l->smooth * ((rate - l->before) / DT - l->slope);
    l->before = rate;
    l->torque = clamp(l->kp * error + l->integral - l->kd * l->slope, -1.0, 1.0);
}

static void drive_motors(vehicle_by_hand_t *v)
{
    for (int i = 0; i < 4; ++i) {
        const double *share = v->share[i];
        v->mixed[i] = clamp(v->thrust + share[0] * v->loops[0].torque + share[1] * v->loops[1].torque +
                                share[2] * v->loops[2].torque,
                            0.0, 1.0);
    }
    for (int i = 0; i < 4; ++i) {
        v->motors[i] += clamp(v->mixed[i] - v->motors[i], -v->slew, v->slew);
    }
}

void vehicle_by_hand_init(vehicle_by_hand_t *v)
{
    static const double waypoints[4][3] = {{50.0, 0.0, 20.0}, {50.0, 50.0, 25.0}, {0.0, 50.0, 20.0}, {0.0, 0.0, 15.0}};
    static const double share[4][3] = {{-1.0, 1.0, 1.0}, {1.0, -1.0, 1.0}, {1.0, 1.0, -1.0}, {-1.0, -1.0, -1.0}};
    *v = (vehicle_by_hand_t){
        .state = HAND_MISSION,
        .gyro_gain = 0.5,
        .accel_gain = 0.1,
        .baro_gain = 0.3,
        .voltage_gain = 0.05,
        .attitude_kp = 0.5,
        .attitude_ki = 0.05,
        .altitude_q = 0.5,
        .altitude_r = 0.3,
        .alpha = 0.2,
        .beta = 0.1,
        .worst_accuracy = 5.0,
        .speed = 5.0,
        .reach = 2.0,
        .hold_speed = 3.0,
        .landing_gain = 0.3,
        .landing_slowest = 0.4,
        .landing_fastest = 2.5,
        .velocity_kp = 2.0,
        .velocity_ki = 0.4,
        .velocity_limit = 3.0,
        .hover = 0.45,
        .attitude_gain = {6.0, 6.0, 2.0},
        .yaw_rate = 1.5,
        .slew = 0.02,
        .radius = 500.0,
        .empty = 13.2,
        .q = {1.0, 0.0, 0.0, 0.0},
        .p00 = 0.3,
        .p11 = 0.3,
    };
    memcpy(v->waypoints, waypoints, sizeof waypoints);
    memcpy(v->share, share, sizeof share);
    for (int i = 0; i < 3; ++i) {
        v->loops[i] = (rate_loop_t){.kp = 0.15, .ki = 0.1, .kd = 0.003, .limit = 0.3, .smooth = 0.2};
    }
    v->loops[2].kp = 0.2;
    v->loops[2].kd = 0.0;
}

/* The slow blocks that are due, estimators first. */
static void estimate(vehicle_by_hand_t *v, uint32_t in_100)
{
    lowpass(v->gyro_filtered, v->gyro, v->gyro_gain, 3);
    lowpass(v->accel_filtered, v->accel, v->accel_gain, 3);
    if (in_100 % 20 == 2) {
        lowpass(&v->baro_filtered, &v->baro, v->baro_gain, 1);
    }
    if (in_100 == 5) {
        lowpass(&v->voltage_filtered, &v->voltage, v->voltage_gain, 1);
    }
    estimate_attitude(v);
    if (in_100 % 4 == 0) {
        estimate_altitude(v);
    }
    if (in_100 % 10 == 1) {
        v->gps_lost = !(v->gps_accuracy < v->worst_accuracy);
        estimate_axis(v, &v->north, 0);
        estimate_axis(v, &v->east, 1);
    }
}

void vehicle_by_hand_step(vehicle_by_hand_t *v)
{
    const uint32_t in_100 = (uint32_t)(v->tick % 100u);
    hand_state_t next = v->state;
    estimate(v, in_100);
    if (in_100 % 20 == 3) {
        choose_velocity(v);
    }
    if (in_100 % 10 == 3) {
        control_velocity(v);
        point_thrust(v);
    }
    if (in_100 % 2 == 0) {
        control_attitude(v);
    }
    for (int i = 0; i < 3; ++i) {
        control_rate(&v->loops[i], v->wanted_rate[i], v->rate[i]);
    }
    drive_motors(v);
    bool land = false, hold = in_100 % 10 == 1 && v->gps_lost;
    if (in_100 == 7) {
        v->distance = sqrt(v->north.position * v->north.position + v->east.position * v->east.position);
        land = v->distance > v->radius;
    }
    if (in_100 % 20 == 3) {
        v->is_low = 1.0 < v->voltage_filtered && v->voltage_filtered < v->empty;
        land = v->is_low || v->mode > 0.5;
        hold = hold || v->mode < -0.5;
    }
    if (v->state != HAND_LANDING && land) {
        next = HAND_LANDING;
    } else if (v->state == HAND_MISSION && hold) {
        next = HAND_HOLD;
    }
    v->state = next;
    v->tick += 1u;
}
