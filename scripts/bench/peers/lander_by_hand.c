/* SPDX-License-Identifier: Apache-2.0 */
#include "lander_by_hand.h"

#include <math.h>
#include <string.h>

static const double DT = 1.0 / 100;
static const double GRAVITY = 1.62;
static const double HOVER = 0.405;
static const double BRAKE = 1.0;
static const double FINAL_ALTITUDE = 2.0;

static double clamp(double x, double low, double high)
{
    return x < low ? low : high < x ? high : x;
}

/* Scalar measurement of state `i` with variance r: gain, state, covariance in Joseph's form. */
static void update(lander_by_hand_t *l, int i, double z, double r)
{
    double s = l->p[i][i] + r;
    double k[2] = {l->p[0][i] / s, l->p[1][i] / s};
    double y = z - l->x[i];
    l->x[0] += k[0] * y;
    l->x[1] += k[1] * y;
    double a[2][2] = {{1.0, 0.0}, {0.0, 1.0}};
    a[0][i] -= k[0];
    a[1][i] -= k[1];
    double ap[2][2];
    for (int m = 0; m < 2; ++m) {
        for (int n = 0; n < 2; ++n) {
            ap[m][n] = a[m][0] * l->p[0][n] + a[m][1] * l->p[1][n];
        }
    }
    for (int m = 0; m < 2; ++m) {
        for (int n = 0; n < 2; ++n) {
            l->p[m][n] = ap[m][0] * a[n][0] + ap[m][1] * a[n][1] + k[m] * r * k[n];
        }
    }
}

static void filter(lander_by_hand_t *l, double pos_z, double vel_z, bool pos_valid, bool vel_valid)
{
    const double r_pos = 0.5 * 0.5, r_vel = 0.3 * 0.3, q = 0.5 * 0.5;
    if (!l->initialised) {
        l->initialised = pos_valid && vel_valid;
        if (l->initialised) {
            l->x[0] = pos_z;
            l->x[1] = vel_z;
            l->p[0][0] = r_pos;
            l->p[1][1] = r_vel;
        }
        return;
    }
    const double g0 = DT * DT / 2.0, g1 = DT;
    l->x[0] += DT * l->x[1];
    if (l->landed) {
        l->x[1] = 0.0;
    } else {
        l->x[0] += g0 * l->acceleration;
        l->x[1] += g1 * l->acceleration;
    }
    double p00 = l->p[0][0] + DT * l->p[1][0], p01 = l->p[0][1] + DT * l->p[1][1];
    double p10 = l->p[1][0], p11 = l->p[1][1];
    l->p[0][0] = p00 + p01 * DT + q * g0 * g0;
    l->p[0][1] = p01 + q * g0 * g1;
    l->p[1][0] = p10 + p11 * DT + q * g1 * g0;
    l->p[1][1] = p11 + q * g1 * g1;
    if (pos_valid) {
        update(l, 0, pos_z, r_pos);
    }
    if (vel_valid) {
        update(l, 1, vel_z, r_vel);
    }
}

static void descend(lander_by_hand_t *l, double touchdown_speed, double burial_depth)
{
    double height = fmax(l->x[0] - FINAL_ALTITUDE, 0.0);
    double target = -sqrt(touchdown_speed * touchdown_speed + 2.0 * BRAKE * height);
    double acceleration = target - l->x[1];
    if (height > 0.0) {
        acceleration += BRAKE;
    }
    l->throttle = clamp(HOVER * (1.0 + acceleration / GRAVITY), 0.0, 1.0);
    bool still = l->x[0] < 1.0 && fabs(l->x[1]) < 0.5 * touchdown_speed;
    l->still = still ? l->still + DT : 0.0;
    if (l->still > 1.0 || l->x[0] < -burial_depth) {
        l->landed = true;
    }
    if (l->landed) {
        l->throttle = 0.0;
    }
}

void lander_by_hand_init(lander_by_hand_t *l)
{
    memset(l, 0, sizeof *l);
    l->mass = 500.0;
}

void lander_by_hand_step(lander_by_hand_t *l, double pos_z, double vel_z)
{
    bool pos_valid = isfinite(pos_z) && pos_z >= -10.0 && pos_z <= 500.0;
    bool vel_valid = isfinite(vel_z) && vel_z >= -50.0 && vel_z <= 50.0;
    l->pos_lost = pos_valid ? 0.0 : l->pos_lost + DT;
    l->vel_lost = vel_valid ? 0.0 : l->vel_lost + DT;
    filter(l, pos_z, vel_z, pos_valid, vel_valid);

    hand_state_t next = l->state;
    l->throttle = 0.0;
    switch (l->state) {
    case HAND_ASCENT:
        l->throttle = clamp(HOVER * (1.0 + (8.0 - l->x[1]) / GRAVITY), 0.0, 1.0);
        if (pos_z >= 40.0) {
            l->throttle = 0.0;
            next = HAND_COAST;
        }
        break;
    case HAND_COAST: {
        double ignition = FINAL_ALTITUDE + (l->x[1] * l->x[1] - 1.0) / (2.0 * BRAKE);
        if (l->x[1] < -1.0 && l->x[0] <= ignition) {
            next = HAND_DESCENT;
        }
        break;
    }
    case HAND_DESCENT:
        descend(l, 1.0, 3.0);
        break;
    case HAND_SAFE:
        descend(l, 1.4, 6.0);
        break;
    }
    if (l->state != HAND_SAFE && (l->pos_lost > 0.05 || l->vel_lost > 0.05)) {
        next = HAND_SAFE;
    }
    l->state = next;

    double thrust = l->throttle * 2000.0;
    l->acceleration = thrust / l->mass - GRAVITY;
    l->mass = fmax(l->mass - thrust / (220.0 * 9.80665) * DT, 400.0);
}
