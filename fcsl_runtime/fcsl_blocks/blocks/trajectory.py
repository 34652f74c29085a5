# SPDX-License-Identifier: Apache-2.0
"""Trajectories of one coordinate: time-optimal within limits, and polynomial in a given time."""

from fcsl_builtins import all, f64, isfinite, max, min, sqrt

#: Times are sums of periods, which are rounded: of a period, this much may be missing.
SLACK = 0.01


def coefficients(start: "f64[3]", end: "f64[3]", total: f64) -> "f64[6]":
    """Of the polynomial in s = t / total between two motions (position, velocity, acceleration)."""
    d = end[0] - start[0]
    v0 = start[1] * total
    v1 = end[1] * total
    q0 = 0.5 * start[2] * total * total
    q1 = 0.5 * end[2] * total * total
    return [
        start[0],
        v0,
        q0,
        10.0 * d - 6.0 * v0 - 4.0 * v1 - 3.0 * q0 + q1,
        -15.0 * d + 8.0 * v0 + 7.0 * v1 + 3.0 * q0 - 2.0 * q1,
        6.0 * d - 3.0 * v0 - 3.0 * v1 - q0 + q1,
    ]


def along(c: "f64[6]", s: f64, total: f64) -> "f64[3]":
    """The motion (position, velocity, acceleration) at s = t / total."""
    x = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    dx = c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5])))
    ddx = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + s * 20.0 * c[5]))
    return [x, dx / total, ddx / total / total]


class Trapezoid:
    """The time-optimal way to a target within limits of velocity and acceleration, planned anew in each run.

    From x and v, braking at the limit A would end at s = x + v |v| / (2 A). The way leads toward d = sign(target - s); with
    D = d (target - x) and w = d v, both along that way, it has three phases:
        from w to the peak p = min(sqrt(A D + w^2 / 2), max_velocity)   in t1 = |p - w| / A
        at p                                                            in t2 = (D - (p^2 - w^2) sign(p - w) / (2 A)
                                                                                - p^2 / (2 A)) / p, if p is max_velocity
        from p to rest at the target                                    in t3 = p / A
    Each run goes one period along it, exactly; with less than a period to go, it ends at the target in every bit. A part of
    an optimal way is the optimal way of its rest, so that planning anew changes it only if the target or a limit has.

    In the first run after a break (`resumed`), the outputs are `track_position` and `track_velocity`. The period is the
    step along the way and does not change the way. A velocity above a lowered limit falls with A; a target that has come
    nearer than the way to stop is passed, and reached from the other side. A target that moves with velocity u is followed
    at a distance of about u^2 / (2 A).

    Source: ODrive, Firmware/MotorControl/trapTraj.cpp (the phases from a present velocity); WPILib, TrapezoidProfile
    (planning anew in each run). The equations: v^2 changes by 2 A per unit of way; p is where the phases 1 and 3 add to D.
    Limits: none of jerk. With positions rounded by e, `remaining` and the arrival may err by 2 sqrt(e / A). A run with a
    target, or at the beginning a tracked motion, that is not finite, or in which a result overflows, is passed over:
    outputs stay, and health is degraded.
    """

    inputs = {
        "target": "f64",  # to be at rest at
        "track_position": "f64",  # position to begin at after a break
        "track_velocity": "f64",  # velocity to begin with after a break; unit of the position per s
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "max_velocity": "f64 in 0..",  # unit of the position per s; 0: brake and stand
        "max_acceleration": "f64 in 1e-9..",  # A, also of braking; unit of the position per s^2
    }
    outputs = {
        "position": "f64",
        "velocity": "f64",  # unit of the position per s
        "acceleration": "f64",  # mean of the last period; unit of the position per s^2
        "remaining": "f64 s",  # time to the target
        "arrived": "bool",  # at rest at the target
    }
    state = {"begun": "bool"}  # since the last break there was a run with finite inputs

    def execute(self):
        self.begun = self.begun and not self.resumed
        if not isfinite(self.target):
            self.health = "degraded"
            return
        if self.begun:
            position = self.position
            velocity = self.velocity
            step = self.period
        else:
            position = self.track_position
            velocity = self.track_velocity
            step = 0.0
        limit = self.max_acceleration
        stop = position + velocity * (0.5 * abs(velocity) / limit)
        way = 1.0 if self.target >= stop else -1.0
        distance = way * (self.target - position)
        speed = way * velocity
        unlimited = sqrt(max(limit * distance + 0.5 * speed * speed, 0.0))
        peak = min(unlimited, self.max_velocity)
        change = limit if peak >= speed else -limit
        to_peak = (peak - speed) / change
        braking = peak / limit
        left = distance - 0.5 * (speed + peak) * to_peak - 0.5 * peak * braking
        cruise = left / peak if unlimited > peak and left > 0.0 else 0.0

        first = min(step, to_peak)
        second = min(step - first, cruise)
        third = step - first - second
        remaining = to_peak + cruise + braking
        if step >= remaining:
            position = self.target
            speed = 0.0
            remaining = 0.0
        else:
            reached = speed + change * first
            position += way * (0.5 * (speed + reached) * first + peak * second + (peak - 0.5 * limit * third) * third)
            speed = reached - limit * third
            remaining -= step
        if not (isfinite(position) and isfinite(speed)):
            self.health = "degraded"
            return
        self.acceleration = (way * speed - velocity) / step if step > 0.0 else 0.0
        self.position = position
        self.velocity = way * speed
        self.remaining = remaining
        self.arrived = remaining <= 0.0
        self.begun = True


class Quintic:
    """The polynomial of fifth degree from a motion (position, velocity, acceleration) to another in a given time.

    x(t) = c0 + c1 s + c2 s^2 + c3 s^3 + c4 s^4 + c5 s^5,  s = t / T, with the six conditions at s = 0 and 1; T: duration
    with d = x1 - x0, and V = v T, Q = a T^2 / 2 of each end:
        c0 = x0, c1 = V0, c2 = Q0
        c3 =  10 d - 6 V0 - 4 V1 - 3 Q0 +   Q1
        c4 = -15 d + 8 V0 + 7 V1 + 3 Q0 - 2 Q1
        c5 =   6 d - 3 V0 - 3 V1 -   Q0 +   Q1
    t = 0 at the beginning, then + period in each run, until T; from then on the outputs are the end's, in every bit.

    In the first run after a break (`resumed`) the tracked motion, the end and the duration are read, and the outputs are
    the tracked motion. A run with `restart` goes its period, too, and then plans a way from there to what the end and the
    duration are now: position, velocity and acceleration are continuous. In other runs these inputs have no effect. A
    changed period does not change the way.

    Source: liba, include/a/trajpoly5.h (the coefficients in t); the ones above are the solution of the six equations in s.
    Limits: none of velocity and acceleration: a short duration makes both large, and with velocities at the ends the way
    may leave the interval between them. T <= 0 is at the end at once. A run that reads an input that is not finite, or in
    which a result overflows, is passed over: outputs and time stay, and health is degraded.
    """

    inputs = {
        "track_position": "f64",  # x0 after a break
        "track_velocity": "f64",  # v0 after a break; unit of the position per s
        "track_acceleration": "f64",  # a0 after a break; unit of the position per s^2
        "end_position": "f64",  # x1
        "end_velocity": "f64",  # v1; unit of the position per s
        "end_acceleration": "f64",  # a1; unit of the position per s^2
        "duration": "f64 s",  # T
        "restart": "bool",  # plan anew, from the present motion
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    outputs = {
        "position": "f64",
        "velocity": "f64",  # unit of the position per s
        "acceleration": "f64",  # unit of the position per s^2
        "remaining": "f64 s",  # time to the end
        "done": "bool",  # at the end
    }
    state = {
        "begun": "bool",  # since the last break there was a run with finite inputs
        "total": "f64 s",  # T of the present way
        "time": "f64 s",  # t
        "c": "f64[6]",
        "end": "f64[3]",  # x1, v1, a1 of the present way
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        end = [self.end_position, self.end_velocity, self.end_acceleration]
        motion = [self.track_position, self.track_velocity, self.track_acceleration]
        plan = self.restart or not self.begun
        if plan and not (all(isfinite(end)) and isfinite(self.duration)):
            self.health = "degraded"
            return
        time = self.time
        if self.begun:
            time = min(self.time + self.period, self.total)
            if time >= self.total - SLACK * self.period:
                time = self.total
                motion = self.end
            else:
                motion = along(self.c, time / self.total, self.total)
        if not all(isfinite(motion)):
            self.health = "degraded"
            return
        if plan:
            time = 0.0
            self.total = max(self.duration, 0.0)
            self.end = end
            self.c = coefficients(motion, end, self.total)
            self.begun = True
            if self.total <= 0.0:
                motion = end
        self.time = time
        self.position, self.velocity, self.acceleration = motion
        self.remaining = self.total - time
        self.done = self.remaining <= 0.0
