# SPDX-License-Identifier: Apache-2.0
"""Attitude from a gyroscope, an accelerometer and, if there is one, a magnetometer."""

from fcsl_builtins import (
    all,
    atan2,
    clamp,
    cos,
    cross3,
    f64,
    hypot,
    isfinite,
    norm,
    quat_conj,
    quat_mul,
    quat_normalize,
    quat_rotate,
    quat_turn,
    sin,
)


def shortest(direction: "f64[3]", side: f64) -> "f64[4]":
    """The shortest rotation of a unit vector to (0, 0, side); about x where it is opposite."""
    scalar = 1.0 + side * direction[2]
    if scalar < 1e-12:
        return [0.0, 1.0, 0.0, 0.0]
    return quat_normalize([scalar, side * direction[1], -side * direction[0], 0.0])


class Mahony:
    """Mahony's complementary filter of attitude: the gyroscope integrated, drawn to gravity and to north, with its bias.

    v = q* (0, 0, up) q    (the expected direction of the accelerometer at rest; up = 1, or -1 with z_down)
    e = acceleration / |acceleration| x v + sin(north error) q* (0, 0, 1) q
    bias' = -ki e, rate = gyro - bias
    q' = q (0, rate + kp e) / 2

    One step turns q by rate, exactly for a constant one, and then by kp e, with the v and e of the turned q: so the
    accelerometer is compared with the attitude of its own time. q leads from the body to the world. The world is east,
    north, up (REP-103) and the accelerometer measures (0, 0, +g) at rest, or with z_down north, east, down and
    (0, 0, -g). The magnetometer corrects rotation about the world's z axis only, so that a disturbed field does not tilt
    the horizon: `north error` is the angle between the horizontal part of the field, turned to the world, and magnetic
    north, `declination` east of true north. A field of zero, such as of an input that is not connected, is not used; then
    yaw is that of the gyroscope.

    The accelerometer corrects only while its length is within acceleration_gate, a part of gravity. The first run, and the
    first after a break (`resumed`), aligns instead: the shortest rotation to the measured vertical from the last attitude
    (at first: the identity), then to north; the bias stays. Until an acceleration other than zero came, health is
    degraded. Each step uses the time since the last sample, so the period may change.

    Source: ahrs (Mayitzin/ahrs, filters/mahony.py: code, documentation, gains), the explicit complementary filter of
    Mahony, Hamel and Pflimlin (2008). The correction by north is the rotation of the measured horizontal field to the
    expected one, reduced to its sine; that after the turn by the gyroscope keeps motion out of the bias.
    Limits: gains times period well below 1. Accelerations that last longer than about 1 / kp tilt the estimate, and a tilt
    error turns yaw by up to tan(dip) times itself. Exactly upside down or with north exactly behind, the corrections
    vanish (unstable equilibria). A sample that is not finite, or that makes the estimate so, is passed over: outputs
    stay, health is degraded, the next sample's step covers the gap.
    """

    inputs = {
        "gyro": "f64[3] rad/s",  # body rates
        "acceleration": "f64[3] m/s^2",  # specific force, body axes
        "magnetic_field": "f64[3]",  # body axes, any unit; zero: none
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "kp": "f64 rad/s in 0.. = 1",  # gain of the attitude; about 1 / kp s is the time of convergence
        "ki": "f64 rad/s^2 in 0.. = 0.3",  # gain of the bias
        "bias_limit": "f64 rad/s in 0.. = 1e308",  # of each element of the bias
        "gravity": "f64 m/s^2 in 1e-3.. = 9.80665",  # length of the acceleration at rest
        "acceleration_gate": "f64 in 0.. = 0.2",  # greatest deviation of that length, relative
        "declination": "f64 rad = 0",  # of magnetic north, positive to the east
        "z_down": "bool = false",  # world NED and body FRD; else ENU and FLU
    }
    outputs = {
        "attitude": "f64[4]",  # quaternion w, x, y, z, body to world
        "rate": "f64[3] rad/s",  # gyro less bias
        "bias": "f64[3] rad/s",  # of the gyroscope
        "aligned": "bool",  # the attitude began at a measured vertical
    }
    state = {
        "since": "f64 s",  # time since the sample before
        "running": "bool",  # aligned since the last break
    }

    def start(self):
        self.attitude[0] = 1.0

    def execute(self):
        if self.resumed:
            self.running = False
        self.since += self.period
        up = -1.0 if self.z_down else 1.0
        force = norm(self.acceleration)
        q = self.attitude
        bias = self.bias
        falls = not force > 0.0  # no vertical
        if self.running:
            q = quat_turn(q, self.since * (self.gyro - bias))
        elif not falls:
            vertical = quat_rotate(q, self.acceleration / force)
            q = quat_mul(shortest(vertical, up), q)

        # the angle of the horizontal field from where magnetic north is, positive for a turn that leads back
        field = quat_rotate(q, self.magnetic_field)
        north = [cos(self.declination), sin(self.declination)]
        if not self.z_down:
            north = [north[1], north[0]]
        ahead = field[0] * north[0] + field[1] * north[1]
        aside = field[0] * north[1] - field[1] * north[0]
        level = hypot(ahead, aside)

        if self.running:
            error = [0.0, 0.0, 0.0]
            if not falls and abs(force / self.gravity - 1.0) <= self.acceleration_gate:
                error = cross3(self.acceleration / force, quat_rotate(quat_conj(q), [0.0, 0.0, up]))
            if level > 0.0:
                error += quat_rotate(quat_conj(q), [0.0, 0.0, aside / level])
            bias = clamp(bias - self.ki * self.since * error, -self.bias_limit, self.bias_limit)
            q = quat_turn(q, self.since * self.kp * error)
        elif not falls:
            half = 0.5 * atan2(aside, ahead)
            q = quat_normalize(quat_mul([cos(half), 0.0, 0.0, sin(half)], q))
        rate = self.gyro - bias
        finite = all(isfinite(q)) and all(isfinite(rate)) and isfinite(level) and isfinite(force)
        if not finite or falls and not self.running:
            self.health = "degraded"
            return
        self.attitude = q
        self.bias = bias
        self.rate = rate
        self.running = True
        self.aligned = True
        self.since = 0.0
