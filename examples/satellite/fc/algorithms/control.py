from __future__ import annotations

from fcsl_builtins import Health, abs, clamp, cross3, matvec, max, norm, quat_conj, quat_mul, quat_rotate, zeros
from rotations import rotation_vector


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Damping:
    """torque = -inertia bandwidth rate: every rate falls as exp(-bandwidth t). Asks for POINT when it is slow.

    Without a gyroscope the torque is zero, and the wheel drive rests.
    """

    inputs = {
        "rate": "f64[3] rad/s",
        "gyroscope_valid": "bool",
        "known": "bool",  # the attitude
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"torque": "f64[3] N*m", "transition_request": "TransitionRequest"}
    parameters = {
        "inertia": "f64[3][3] kg*m^2",
        "bandwidth": "f64 rad/s in 0..",
        "slow_rate": "f64 rad/s",
        "slow_s": "f64 s",  # so long it must be slow, and know its attitude
        "on_slow": "TransitionRequest",
    }
    state = {"slow": "f64 s"}

    def execute(self):
        self.torque = zeros(3)
        if self.gyroscope_valid:
            self.torque = matvec(self.inertia, self.rate) * -self.bandwidth
        calm = self.gyroscope_valid and self.known and norm(self.rate) < self.slow_rate
        self.slow = self.slow + self.dt if calm and not self.resumed else 0.0
        if self.slow > self.slow_s:
            self.transition_request = self.on_slow


class Point:
    """Quaternion feedback about the reference, with an integral.

        torque = inertia (wr' + kp e + ki integral of e + kd (wr - w))      e: rotation vector to the reference

    The loop is e''' + kd e'' + kp e' + ki e = 0 about each axis. The gains place its poles at -natural,
    natural (-damping +- i sqrt(1 - damping^2)) and -integral:

        kd = 2 damping natural + integral,  kp = natural^2 + 2 damping natural integral,  ki = natural^2 integral
    """

    inputs = {
        "attitude": "f64[4]",
        "rate": "f64[3] rad/s",
        "reference": "f64[4]",
        "reference_rate": "f64[3] rad/s",
        "reference_acceleration": "f64[3] rad/s^2",
        "limited": "bool",  # the wheels gave less than was asked for
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"torque": "f64[3] N*m", "error": "f64[3] rad"}
    parameters = {
        "inertia": "f64[3][3] kg*m^2",
        "natural": "f64 rad/s in 0..",
        "damping": "f64 in 0..",
        "integral": "f64 rad/s in 0..",
        "integral_limit": "f64 rad*s in 0..",
    }
    state = {"sum": "f64[3] rad*s"}

    def execute(self):
        kd = 2.0 * self.damping * self.natural + self.integral
        kp = self.natural**2 + 2.0 * self.damping * self.natural * self.integral
        ki = self.natural**2 * self.integral
        between = quat_mul(quat_conj(self.attitude), self.reference)
        self.error = rotation_vector(between)
        if self.resumed:
            self.sum = zeros(3)
        if not self.limited:
            for i in range(3):
                step = self.error[i] * self.dt
                self.sum[i] = clamp(self.sum[i] + step, -self.integral_limit, self.integral_limit)
        lacking = quat_rotate(between, self.reference_rate) - self.rate
        push = quat_rotate(between, self.reference_acceleration)
        self.torque = matvec(self.inertia, push + self.error * kp + self.sum * ki + lacking * kd)


class WheelDrive:
    """Body torque to the motors of four wheels, with what the wheels do themselves.

        total = torque + w x (inertia w + sum of h axis)
        motor = -axes^+ total + friction(speed) + null (1, 1, -1, -1),   axes^+ = axes' (axes axes')^-1

    The axes are a pyramid about body z with equal strength in all directions: axes axes' = 4/3. Speeds of the form
    (s, s, -s, -s) make no momentum. `null` holds them at `bias_speed`, away from the stiction at zero. Torque beyond
    `max_torque` of a motor is scaled down for all of them, so its direction stays.

    A wheel at `max_speed` is saturated: degraded. Momentum is not unloaded: that needs magnetic torquers.
    """

    inputs = {
        "detumble_torque": "f64[3] N*m",
        "detumble_health": "Health",
        "point_torque": "f64[3] N*m",
        "point_health": "Health",
        "safe_torque": "f64[3] N*m",
        "safe_health": "Health",
        "rate": "f64[3] rad/s",
        "gyroscope_valid": "bool",
        "speed_1": "f64 rad/s",
        "speed_2": "f64 rad/s",
        "speed_3": "f64 rad/s",
        "speed_4": "f64 rad/s",
    }
    outputs = {
        "motor_1": "f64 N*m",
        "motor_2": "f64 N*m",
        "motor_3": "f64 N*m",
        "motor_4": "f64 N*m",
        "torque": "f64[3] N*m",  # that was asked for, of the controller that flies
        "momentum": "f64[3] N*m*s",  # of the wheels, body axes
        "limited": "bool",
        "saturated": "bool",
    }
    parameters = {
        "axes": "f64[3][4]",
        "inertia": "f64[3][3] kg*m^2",
        "wheel_inertia": "f64 kg*m^2",
        "max_torque": "f64 N*m",
        "max_speed": "f64 rad/s",
        "viscous_friction": "f64 N*m*s/rad",
        "coulomb_friction": "f64 N*m",
        "bias_speed": "f64 rad/s",
        "bias_bandwidth": "f64 rad/s",
    }

    def execute(self):
        speed = [self.speed_1, self.speed_2, self.speed_3, self.speed_4]
        self.momentum = matvec(self.axes, speed) * self.wheel_inertia
        if commands(self.safe_health):
            self.torque = self.safe_torque
        elif commands(self.point_health):
            self.torque = self.point_torque
        elif commands(self.detumble_health):
            self.torque = self.detumble_torque
        elif self.safe_health == "stale" and self.point_health == "stale" and self.detumble_health == "stale":
            self.torque = zeros(3)
        self.saturated = False
        for i in range(4):
            self.saturated = self.saturated or abs(speed[i]) > 0.99 * self.max_speed
        motor = zeros(4)
        self.limited = self.saturated
        if self.gyroscope_valid:
            total = self.torque + cross3(self.rate, matvec(self.inertia, self.rate) + self.momentum)
            mean = 0.25 * (speed[0] + speed[1] - speed[2] - speed[3])
            null = self.wheel_inertia * self.bias_bandwidth * (self.bias_speed - mean)
            null = clamp(null, -0.2 * self.max_torque, 0.2 * self.max_torque)
            most = 0.0
            for i in range(4):
                for j in range(3):
                    motor[i] -= 0.75 * self.axes[j, i] * total[j]
                motor[i] += null if i < 2 else -null
                slide = clamp(speed[i], -1.0, 1.0)
                motor[i] += self.viscous_friction * speed[i] + self.coulomb_friction * slide
                most = max(most, abs(motor[i]))
            if most > self.max_torque:
                motor = motor * (self.max_torque / most)
                self.limited = True
        self.motor_1, self.motor_2, self.motor_3, self.motor_4 = motor
        self.health = "degraded" if self.saturated else "nominal"
