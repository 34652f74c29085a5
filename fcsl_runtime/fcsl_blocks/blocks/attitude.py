# SPDX-License-Identifier: Apache-2.0
"""Attitude control in two loops: attitude to body rates, body rates to torques."""

from fcsl_builtins import (
    all,
    any,
    atan2,
    clamp,
    cos,
    f64,
    hypot,
    isfinite,
    max,
    min,
    quat_conj,
    quat_mul,
    quat_normalize,
    quat_rotate,
    sin,
)


def unit(q: "f64[4]") -> "f64[4]":
    """q / |q|, also where the squares would overflow or vanish."""
    return quat_normalize(q / max(abs(q)))


class AttitudeLaw:
    """Body rates that turn the vehicle to a target attitude, by the quaternion error, optionally tilt first.

    e = q* target, of the sign with e0 >= 0    (the rotation from the body to the target, in body axes)
    e = tilt (cos h, 0, 0, sin h), tilt = (e0', ex', ey', 0)    (the shortest rotation that aligns the z axes, then yaw 2 h)
    e_w = tilt (cos(yaw_weight h), 0, 0, sin(yaw_weight h))
    command = clamp(gain 2 (ex, ey, ez of e_w) + e target_rate e*, -limit, limit)

    With yaw_weight = 1 the whole error counts. Below, yaw counts less and tilt is corrected along the shortest way; with 0
    yaw is free (reduced attitude): what a multirotor wants, whose yaw is weak and whose thrust is along z. The rate is
    2 gain sin(angle / 2): at small errors gain times the angle. The block has no memory: first run, breaks and period make
    no difference.

    Source: PX4 Autopilot, AttitudeControl.cpp (error, reduced attitude, weight of yaw); the weight here does not change
    `gain`. The split is that of a rotation into swing and twist about z: the twist is (e0, 0, 0, ez) normalized.
    Limits: at 180 degrees of tilt error yaw is not defined: there the whole error counts. At 180 degrees of error the way is
    that which the signs of e give. Quaternions need not be of unit length. If one has none or is not finite, or target_rate is
    not, the run is passed over: outputs stay, and health is degraded.
    """

    inputs = {
        "attitude": "f64[4]",  # quaternion w, x, y, z, body to world
        "target": "f64[4]",  # quaternion w, x, y, z, target body to world
        "target_rate": "f64[3] rad/s",  # angular velocity of the target, in the target's body axes
    }
    parameters = {
        "gain": "f64[3] 1/s in 0..",  # about body x, y, z
        "yaw_weight": "f64 in 0..1 = 1",
        "limit": "f64[3] rad/s in 0.. = 1e308",  # of the commanded rates
    }
    outputs = {
        "command": "f64[3] rad/s",  # body rates
        "error": "f64[3] rad",  # rotation from the body to the target, 2 sin(angle / 2) along its axis, yaw weighted
        "saturated": "bool",  # a rate is at its limit
    }

    def execute(self):
        whole = quat_mul(quat_conj(unit(self.attitude)), unit(self.target))
        if whole[0] < 0.0:
            whole = -whole
        error = whole
        length = hypot(whole[0], whole[3])
        if length > 0.0:
            tilt = quat_mul(whole, [whole[0] / length, 0.0, 0.0, -whole[3] / length])
            half = self.yaw_weight * atan2(whole[3], whole[0])
            if self.yaw_weight < 1.0:
                error = quat_mul(tilt, [cos(half), 0.0, 0.0, sin(half)])
        wanted = 2.0 * self.gain * error[1:] + quat_rotate(whole, self.target_rate)
        if not all(isfinite(wanted)):
            self.health = "degraded"
            return
        self.error = 2.0 * error[1:]
        self.command = clamp(wanted, -self.limit, self.limit)
        self.saturated = any(abs(wanted) > self.limit)


class RateLoop:
    """Body rates to torques: a PI controller per axis with the derivative of the measured rate, and anti-windup.

    P = kp (target - rate)
    I' = ki (target - rate) + (applied - torque of the run before) / tracking_time
    D = -kd s / (1 + derivative_time s) rate
    v = P + I + D + feedforward, torque = clamp(v, -limit, limit)

    I is integrated by forward Euler behind the torque, D by backward differences. With tracking_time > 0, I follows the
    torque that the vehicle really had: connect `applied` from the mixer, delayed (back-calculation). In any case I stands
    still on an axis while v is beyond its limit and the error would drive it further (clamping), and on all axes while
    `hold` is true, such as on the ground; it stays within -integral_limit..integral_limit. In the first run, also after a
    break (`resumed`), I = 0 and D = 0. ki is inside the integral, so that a change of ki makes no jump. Each step uses
    the present period.

    Source: PX4 Autopilot, rate_control.cpp (PI on the error, D on the measured rate, stop of the integral on saturation and
    on the ground). Back-calculation is the usual first-order tracking of the applied value.
    Limits: axes are independent; gyroscopic torque belongs to `feedforward`. A tracking_time below the period acts as the
    period. If an input is not finite, the run is passed over: the torques stay, health is degraded, and a
    start waits.
    """

    inputs = {
        "target": "f64[3] rad/s",  # body rates wanted
        "rate": "f64[3] rad/s",  # body rates measured
        "feedforward": "f64[3] N*m",  # added before the limits
        "applied": "f64[3] N*m",  # what became of the torque of the run before; with tracking_time > 0
        "hold": "bool",  # the integral stands still
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "kp": "f64[3] N*m*s/rad in 0..",  # gain
        "ki": "f64[3] N*m/rad in 0.. = 0",  # integral gain
        "kd": "f64[3] N*m*s^2/rad in 0.. = 0",  # derivative gain
        "derivative_time": "f64 s in 0.. = 0",  # of the filter of D
        "limit": "f64[3] N*m in 0.. = 1e308",  # of the torques
        "integral_limit": "f64[3] N*m in 0.. = 1e308",  # of I
        "tracking_time": "f64 s in 0.. = 0",  # of back-calculation; 0: none
    }
    outputs = {
        "torque": "f64[3] N*m",
        "saturated": "bool[3]",  # v is beyond the limit of this axis
    }
    state = {
        "integral": "f64[3] N*m",
        "derivative": "f64[3] N*m",
        "last": "f64[3] rad/s",  # rate of the run before
        "begun": "bool",  # there is a run before, since the last break
    }

    def execute(self):
        error = self.target - self.rate
        if self.resumed:
            self.begun = False
        if not self.begun:
            integral = 0.0 * error
            derivative = 0.0 * error
        else:
            lag = self.derivative_time + self.period
            derivative = (self.derivative_time * self.derivative - self.kd * (self.rate - self.last)) / lag
            integral = self.integral
            if self.tracking_time > 0.0 and not self.hold:
                integral += min(self.period / self.tracking_time, 1.0) * (self.applied - self.torque)
        wanted = self.kp * error + integral + derivative + self.feedforward
        step = self.ki * error * self.period
        for i in range(3):
            if self.hold or wanted[i] > self.limit[i] and step[i] > 0.0 or wanted[i] < -self.limit[i] and step[i] < 0.0:
                step[i] = 0.0
        integral = clamp(integral + step, -self.integral_limit, self.integral_limit)
        if not (all(isfinite(wanted)) and all(isfinite(integral)) and all(isfinite(self.applied))):
            self.health = "degraded"
            return
        self.begun = True
        self.torque = clamp(wanted, -self.limit, self.limit)
        self.saturated = self.torque != wanted
        self.integral = integral
        self.derivative = derivative
        self.last = self.rate
