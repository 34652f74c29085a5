/* SPDX-License-Identifier: Apache-2.0
 *
 * Attitude of a rigid body: a quaternion (w, x, y, z) from the body to the world, and rates in the body.
 */
#ifndef BENCH_RIGID_H
#define BENCH_RIGID_H

/* The derivative of the quaternion; what keeps its norm at 1 is part of it. */
static inline void rigid_turn(const double *q, const double *w, double *dq)
{
    const double excess = 1.0 - (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    dq[0] = 0.5 * (-q[1] * w[0] - q[2] * w[1] - q[3] * w[2]) + excess * q[0];
    dq[1] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]) + excess * q[1];
    dq[2] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]) + excess * q[2];
    dq[3] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]) + excess * q[3];
}

/* Euler's equations in principal axes. */
static inline void rigid_spin(const double *inertia, const double *w, const double *torque, double *dw)
{
    dw[0] = (torque[0] - (inertia[2] - inertia[1]) * w[1] * w[2]) / inertia[0];
    dw[1] = (torque[1] - (inertia[0] - inertia[2]) * w[2] * w[0]) / inertia[1];
    dw[2] = (torque[2] - (inertia[1] - inertia[0]) * w[0] * w[1]) / inertia[2];
}

#endif /* BENCH_RIGID_H */
