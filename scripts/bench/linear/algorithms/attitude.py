# SPDX-License-Identifier: Apache-2.0
"""An attitude controller on quaternions around a rate controller with an integral, for a rigid body."""

from fcsl_builtins import clamp, cross3, matvec, quat_conj, quat_mul


class Inputs:
    q: "f64[4]"  # attitude, body to world
    rate: "f64[3] rad/s"
    q_wanted: "f64[4]"
    rate_wanted: "f64[3] rad/s"


class Parameters:
    inertia: "f64[3, 3]"
    attitude_gain: f64
    rate_gain: f64
    integral_gain: f64
    limit: f64  # of the trim (the integral), each axis
    dt: f64


class Outputs:
    torque: "f64[3]"


class State:
    trim: "f64[3]"


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    error = quat_mul(quat_conj(u.q), u.q_wanted)
    side = 2.0 if error[0] >= 0.0 else -2.0  # the short way round
    wanted = u.rate_wanted + (side * p.attitude_gain) * [error[1], error[2], error[3]]
    rate_error = wanted - u.rate
    for i in range(3):
        x.trim[i] = clamp(x.trim[i] + p.dt * rate_error[i], -p.limit, p.limit)
    acceleration = p.rate_gain * rate_error + p.integral_gain * x.trim
    y.torque = matvec(p.inertia, acceleration) + cross3(u.rate, matvec(p.inertia, u.rate))
