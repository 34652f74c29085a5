/* SPDX-License-Identifier: Apache-2.0
 *
 * The attitude controller with Eigen: fixed sizes, its own quaternions.
 */
#include "kernel.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>

namespace
{

using Vector = Eigen::Vector3d;

Eigen::Matrix3d inertia;
Vector integral, torque;

Eigen::Quaterniond quaternion(const double *q) /* scalar first */
{
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
}

void step(const double *u)
{
    const Eigen::Map<const Vector> rate(u + 4), rate_wanted(u + 11);
    const Eigen::Quaterniond error = quaternion(u).conjugate() * quaternion(u + 7);
    const double side = error.w() >= 0.0 ? 2.0 : -2.0;
    const Vector rate_error = rate_wanted + side * 8.0 * error.vec() - rate;
    integral = (integral + 0.01 * rate_error).cwiseMax(-0.5).cwiseMin(0.5);
    const Vector acceleration = 20.0 * rate_error + 4.0 * integral;
    const Vector momentum = inertia * rate;
    torque = inertia * acceleration + rate.cross(momentum);
}

} // namespace

void kernel_reset(void)
{
    inertia << 0.02, 0.0, -0.001, 0.0, 0.025, 0.0, -0.001, 0.0, 0.04;
    integral.setZero();
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        step(inputs + 14 * k);
    }
}

void kernel_result(double *result)
{
    Eigen::Map<Vector> first(result), second(result + 3);
    first = torque;
    second = integral;
}
