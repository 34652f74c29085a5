/* SPDX-License-Identifier: Apache-2.0
 *
 * A quadrotor with constant thrusts, and drag of what moves and turns: 13 states, which are position, velocity, quaternion, rates.
 */
#ifndef BENCH_QUADROTOR_H
#define BENCH_QUADROTOR_H

#include "rigid.h"

enum { QUADROTOR_STATES = 13 };

typedef struct {
    struct {
        double mass, gravity, arm, yaw, drag, turning_drag;
        double inertia[3];
        double thrust[4];
    } parameters;
    struct {
        double x[QUADROTOR_STATES];
    } state;
    struct {
        double x[QUADROTOR_STATES];
    } outputs;
} quadrotor_t;

static inline void quadrotor_derivative(const quadrotor_t *quadrotor, const double *x, double *dx)
{
    const double *v = x + 3;
    const double *q = x + 6;
    const double *w = x + 10;
    const double *thrust = quadrotor->parameters.thrust;
    const double drag = quadrotor->parameters.drag;
    const double mass = quadrotor->parameters.mass;
    const double lift = thrust[0] + thrust[1] + thrust[2] + thrust[3];
    const double torque[3] = {
        quadrotor->parameters.arm * (thrust[1] - thrust[3]) - quadrotor->parameters.turning_drag * w[0],
        quadrotor->parameters.arm * (thrust[2] - thrust[0]) - quadrotor->parameters.turning_drag * w[1],
        quadrotor->parameters.yaw * (thrust[0] - thrust[1] + thrust[2] - thrust[3]) -
            quadrotor->parameters.turning_drag * w[2],
    };
    dx[0] = v[0];
    dx[1] = v[1];
    dx[2] = v[2];
    dx[3] = (2.0 * (q[1] * q[3] + q[0] * q[2]) * lift - drag * v[0]) / mass;
    dx[4] = (2.0 * (q[2] * q[3] - q[0] * q[1]) * lift - drag * v[1]) / mass;
    dx[5] = ((1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])) * lift - drag * v[2]) / mass - quadrotor->parameters.gravity;
    rigid_turn(q, w, dx + 6);
    rigid_spin(quadrotor->parameters.inertia, w, torque, dx + 10);
}

#endif /* BENCH_QUADROTOR_H */
