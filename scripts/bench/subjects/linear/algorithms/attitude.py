# SPDX-License-Identifier: Apache-2.0
from fcsl_builtins import clamp, cross3, matvec, quat_conj, quat_mul


class Attitude:
    """An attitude controller on quaternions around a rate controller with an integral, for a rigid body."""

    inputs = {
        "q": "f64[4]",  # attitude, body to world
        "rate": "f64[3] rad/s",
        "q_wanted": "f64[4]",
        "rate_wanted": "f64[3] rad/s",
    }
    outputs = {"torque": "f64[3]"}
    parameters = {
        "inertia": "f64[3][3]",
        "attitude_gain": "f64",
        "rate_gain": "f64",
        "integral_gain": "f64",
        "limit": "f64",  # of the trim (the integral), each axis
        "dt": "f64",
    }
    state = {"trim": "f64[3]"}

    def execute(self):
        error = quat_mul(quat_conj(self.q), self.q_wanted)
        side = 2.0 if error[0] >= 0.0 else -2.0  # the short way round
        wanted = self.rate_wanted + (side * self.attitude_gain) * [error[1], error[2], error[3]]
        rate_error = wanted - self.rate
        for i in range(3):
            self.trim[i] = clamp(self.trim[i] + self.dt * rate_error[i], -self.limit, self.limit)
        acceleration = self.rate_gain * rate_error + self.integral_gain * self.trim
        self.torque = matvec(self.inertia, acceleration) + cross3(self.rate, matvec(self.inertia, self.rate))
