"""The cascade: position and velocity to a thrust vector, attitude to rates, rates to torques."""

from __future__ import annotations

from fcsl_builtins import (
    Health,
    clamp,
    cross3,
    dot,
    exp,
    hypot,
    max,
    min,
    norm,
    quat_rotate,
    tan,
    zeros,
)
from rotations import DOWN, pointed


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones."""
    return law == "nominal" or law == "degraded"


class Position:
    """Position and velocity control, and the attitude and thrust that make the acceleration.

        a = a_ref + kv (v_ref + kp (p_ref - p) - v) + i,    i' = ki (v_ref + kp (p_ref - p) - v)
        f = a - g = -(thrust / mass) z_body

    The vertical is limited first, then the horizontal part to `tilt_limit`. The integral stands still while a limit
    holds or the vehicle has not left the ground. In SAFE (the reference is stale) the vehicle levels with the time
    constant `level_s`, keeps its yaw, and its vertical speed goes to `sink_speed` with the acceleration `sink_rate`.
    Without a barometer the thrust is the share `blind_share` of the weight, and the inflow of the rotors limits the
    sink rate.
    """

    inputs = {
        "reference_health": "Health",
        "reference_position": "f64[3] m",
        "reference_velocity": "f64[3] m/s",
        "reference_acceleration": "f64[3] m/s^2",
        "reference_yaw": "f64 rad",
        "spool": "f64",  # of the take-off
        "position": "f64[3] m",
        "velocity": "f64[3] m/s",
        "attitude": "f64[4]",
        "barometer_age": "f64 s",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "attitude_command": "f64[4]",
        "thrust": "f64 N",
        "thrust_share": "f64",  # of the weight
        "acceleration_command": "f64[3] m/s^2",
        "flying": "bool",  # it has left the ground
        "yaw": "f64 rad",  # commanded
    }
    parameters = {
        "mass": "f64 kg",
        "gravity": "f64 m/s^2",
        "kp": "f64[3] 1/s",
        "kv": "f64[3] 1/s",
        "ki": "f64[3] 1/s^2",
        "integral_limit": "f64 m/s^2",
        "tilt_limit": "f64 rad",
        "climb_limit": "f64 m/s^2",  # of the vertical acceleration, up and down
        "leave_height": "f64 m",  # above the place of the start: it flies
        "sink_speed": "f64 m/s",
        "sink_rate": "f64 m/s^2",
        "level_s": "f64 s in 0.01..",
        "blind_share": "f64",
        "barometer_patience": "f64 s",
    }
    state = {
        "integral": "f64[3] m/s^2",
        "ground": "f64 m",
        "sink": "f64 m/s",  # the vertical speed that is wanted
        "lean": "f64[2] m/s^2",  # the horizontal acceleration that is wanted
    }

    def execute(self):
        safe = not commands(self.reference_health)  # also when it failed: its outputs may be those of another flight
        blind = safe and self.barometer_age > self.barometer_patience
        if self.resumed:
            self.integral = zeros(3)
            self.ground = self.position[2]
            self.flying = False
        if self.position[2] < self.ground - self.leave_height or self.reference_health == "stale":
            self.flying = True

        # ---- position: what velocity is wanted, and how far that is away
        lacking = zeros(3)
        if safe:
            self.sink += clamp(self.sink_speed - self.sink, -self.sink_rate * self.dt, self.sink_rate * self.dt)
            lacking[2] = self.sink - self.velocity[2]
        else:
            self.yaw = self.reference_yaw
            for i in range(3):
                wanted = self.reference_velocity[i] + self.kp[i] * (self.reference_position[i] - self.position[i])
                lacking[i] = wanted - self.velocity[i]
            self.sink = lacking[2] + self.velocity[2]

        # ---- velocity: what acceleration is wanted, within the limits
        command = self.integral
        for i in range(3):
            command[i] += self.kv[i] * lacking[i]
        if not safe:
            command = command + self.reference_acceleration
        vertical = clamp(command[2], -self.climb_limit, self.climb_limit)
        if blind:
            vertical = self.gravity * (1.0 - self.blind_share)
        room = (self.gravity - vertical) * tan(self.tilt_limit)
        fit = min(1.0, room / max(hypot(command[0], command[1]), 1e-6))
        if safe:
            self.lean = self.lean * exp(-self.dt / self.level_s)
        else:
            self.lean = command[0:2] * fit
        for i in range(3):
            free = fit == 1.0 and not safe if i < 2 else vertical == command[2]
            if self.flying and free:
                grown = self.integral[i] + self.ki[i] * lacking[i] * self.dt
                self.integral[i] = clamp(grown, -self.integral_limit, self.integral_limit)

        # ---- thrust vector
        self.acceleration_command = [self.lean[0], self.lean[1], vertical]
        force = [self.lean[0], self.lean[1], vertical - self.gravity]
        self.attitude_command = pointed(-force / norm(force), self.yaw)
        # While the vehicle still turns, its present axis carries what it can: the height comes before the place.
        share = max(-dot(force, quat_rotate(self.attitude, DOWN)), 0.0) / self.gravity
        self.thrust_share = share * self.spool
        self.thrust = self.mass * self.gravity * self.thrust_share


class Rate:
    """Rate control with the lag of the motors in mind: poles placed by feedback of rate and of the modelled torque.

        u = J (k (w_command - w) + i) - c torque + w x J w,    i' = ki (w_command - w)
        torque' = (u - torque) / lag

    With lag s^2 + (1 + c) s + k = lag (s^2 + 2 d n s + n^2) follow k = lag n^2 and c = 2 d n lag - 1. `torque` is the
    model of what the motors give of the u that the mixer let through. The integral stands still while the mixer is at a
    limit, and on the ground.
    """

    inputs = {
        "gyro": "f64[3] rad/s",  # at the tick: the filter's rate is the mean of the period before, and later
        "gyro_bias": "f64[3] rad/s",
        "rate_command": "f64[3] rad/s",
        "given": "f64[3] N*m",  # by the mixer, in the tick before
        "limited": "bool",
        "flying": "bool",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"torque": "f64[3] N*m"}
    parameters = {
        "inertia": "f64[3] kg*m^2",
        "k": "f64[3] 1/s",
        "c": "f64[3]",
        "ki": "f64[3] 1/s^2",
        "lag": "f64 s in 0.001..",
        "integral_limit": "f64 rad/s^2",
    }
    state = {"integral": "f64[3] rad/s^2", "modelled": "f64[3] N*m"}

    def execute(self):
        if self.resumed:
            self.integral = zeros(3)
            self.modelled = zeros(3)
        rate = self.gyro - self.gyro_bias
        self.modelled = self.modelled + (self.given - self.modelled) * (1.0 - exp(-self.dt / self.lag))
        momentum = zeros(3)
        for i in range(3):
            momentum[i] = self.inertia[i] * rate[i]
        gyroscopic = cross3(rate, momentum)
        for i in range(3):
            error = self.rate_command[i] - rate[i]
            if self.flying and not self.limited:
                grown = self.integral[i] + self.ki[i] * error * self.dt
                self.integral[i] = clamp(grown, -self.integral_limit, self.integral_limit)
            wanted = self.inertia[i] * (self.k[i] * error + self.integral[i])
            self.torque[i] = wanted - self.c[i] * self.modelled[i] + gyroscopic[i]
