"""From an acceleration to an attitude, a throttle, two angles of the nozzle, and four roll thrusters."""

from __future__ import annotations

from fcsl_builtins import (
    Health,
    abs,
    asin,
    clamp,
    dot,
    exp,
    f64,
    hypot,
    isfinite,
    max,
    min,
    norm,
    quat_conj,
    quat_mul,
    quat_rotate,
    sqrt,
    tan,
    zeros,
)
from rotations import DOWN, pointed

STANDARD_GRAVITY = 9.80665


def shortened(v: f64[3], most: f64) -> f64[3]:
    """v, with at most that length."""
    return v * min(1.0, most / max(norm(v), 1e-6))


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Propulsion:
    """What the engine does and the tank has left: the model of the engine, and how the accelerometer differs from it.

        y' = (u - y) / lag,    T = y max_thrust - back_pressure,    propellant' = -y max_thrust / (g0 Isp)
        propellant += gauge_gain (gauge - propellant),  by each sample of the gauge; the first one is taken as it is
        factor' = (m (-f_z) / T - factor) / factor_s

    `factor` has the errors of thrust and mass, and the drag along the axis. It rests near the ground, whose force is
    felt too, and below `least`.
    """

    inputs = {
        "throttle": "f64",  # commanded in the tick before
        "specific_force": "f64[3] m/s^2",
        "height": "f64 m",
        "gauge": "f64 kg",
        "gauge_fresh": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "thrust": "f64 N",  # model and factor
        "factor": "f64",
        "propellant": "f64 kg",
        "mass": "f64 kg",
    }
    parameters = {
        "dry_mass": "f64 kg in 1..",
        "full": "f64 kg",
        "max_thrust": "f64 N",
        "back_pressure": "f64 N",
        "specific_impulse": "f64 s in 1..",
        "lag": "f64 s in 0.001..",
        "factor_s": "f64 s in 0.1..",
        "gauge_gain": "f64 in 0..1",
        "least": "f64 N",
        "least_height": "f64 m",
    }
    state = {"y": "f64", "gauged": "bool"}

    def start(self):
        self.propellant = self.full
        self.factor = 1.0

    def execute(self):
        self.y += (self.throttle - self.y) * (1.0 - exp(-self.dt / self.lag))
        burnt = self.y * self.max_thrust / (STANDARD_GRAVITY * self.specific_impulse) * self.dt
        self.propellant -= burnt
        if self.gauge_fresh and isfinite(self.gauge):
            self.propellant += (self.gauge_gain if self.gauged else 1.0) * (self.gauge - self.propellant)
            self.gauged = True
        self.propellant = max(self.propellant, 0.0)
        self.mass = self.dry_mass + self.propellant
        model = max(self.y * self.max_thrust - self.back_pressure, 0.0)
        if model > self.least and self.height > self.least_height:
            felt = -self.mass * self.specific_force[2] / model
            self.factor = clamp(self.factor + (felt - self.factor) * (self.dt / self.factor_s), 0.8, 1.2)
        self.thrust = model * self.factor


class Steering:
    """The acceleration of the state that runs, within the limits, as an attitude and a thrust.

    The vertical comes first: it is limited to what the engine can, then the horizontal part to the tilt and to what is
    left. A filter makes it smooth, so a change of state has no bump, and gives `Attitude` a rate to follow:

        a'' = bandwidth^2 (a_wanted - a) - 2 bandwidth a',    |a'| at most `jerk`, |a''| at most `snap`
    """

    inputs = {
        "ascent_health": "Health",
        "ascent": "f64[3] m/s^2",
        "descent_health": "Health",
        "descent": "f64[3] m/s^2",
        "terminal_health": "Health",
        "terminal": "f64[3] m/s^2",
        "safe_health": "Health",
        "safe": "f64[3] m/s^2",
        "attitude": "f64[4]",
        "height": "f64 m",
        "mass": "f64 kg",
        "factor": "f64",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "acceleration": "f64[3] m/s^2",  # of the thrust, NED, after limits and filter
        "attitude_command": "f64[4]",
        "rate_command": "f64[3] rad/s",
        "thrust": "f64 N",
        "flying": "bool",
    }
    parameters = {
        "heading": "f64 rad",
        "bandwidth": "f64 rad/s in 0.1..",
        "jerk": "f64 m/s^3 in 0.1..",
        "snap": "f64 m/s^4 in 0.1..",
        "tilt_limit": "f64 rad",
        "least_thrust": "f64 N",
        "most_thrust": "f64 N",
        "leave_height": "f64 m",
    }
    state = {"wanted": "f64[3] m/s^2", "slope": "f64[3] m/s^3"}

    def execute(self):
        if commands(self.ascent_health):
            self.wanted = self.ascent
        elif commands(self.descent_health):
            self.wanted = self.descent
        elif commands(self.terminal_health):
            self.wanted = self.terminal
        elif commands(self.safe_health):
            self.wanted = self.safe
        if self.height > self.leave_height:
            self.flying = True

        least = self.least_thrust * self.factor / self.mass
        most = self.most_thrust * self.factor / self.mass
        up = clamp(-self.wanted[2], least, most)
        side = hypot(self.wanted[0], self.wanted[1])
        room = min(up * tan(self.tilt_limit), sqrt(max(most * most - up * up, 0.0)))
        fit = min(1.0, room / max(side, 1e-6))
        limited = [self.wanted[0] * fit, self.wanted[1] * fit, -up]
        if self.resumed:
            self.acceleration = limited
            self.slope = zeros(3)
        else:
            n = self.bandwidth
            bend = (limited - self.acceleration) * (n * n) - self.slope * (2.0 * n)
            self.slope = self.slope + shortened(bend, self.snap) * self.dt
            self.slope = shortened(self.slope, self.jerk)
            self.acceleration = self.acceleration + self.slope * self.dt
        before = self.attitude_command
        self.attitude_command = pointed(-self.acceleration / norm(self.acceleration), self.heading)
        turn = quat_mul(quat_conj(before), self.attitude_command)
        self.rate_command = zeros(3) if self.resumed else [2.0 * turn[1], 2.0 * turn[2], 2.0 * turn[3]] / self.dt
        # While it still turns, the present axis carries what it can: the height comes before the place.
        self.thrust = self.mass * max(-dot(self.acceleration, quat_rotate(self.attitude, DOWN)), least)


class Attitude:
    """Angular acceleration about x and y: state feedback of angle, rate and the integral of the angle.

        u = k e + k_rate (w_command - w) + k_integral integral(e)

    Linear-quadratic gains of e'' = -u; the plant between u and the angle is made this double integrator by `Actuators`.
    The integral takes up the torque of a centre of mass beside the axis. It stands still on the ground and while the
    nozzle is at its end.
    """

    inputs = {
        "attitude": "f64[4]",
        "command": "f64[4]",
        "rate_command": "f64[3] rad/s",
        "rate": "f64[3] rad/s",
        "limited": "bool",
        "flying": "bool",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"angular_acceleration": "f64[2] rad/s^2", "error": "f64[3] rad"}
    parameters = {
        "k": "f64 1/s^2",
        "k_rate": "f64 1/s",
        "k_integral": "f64 1/s^3",
        "error_limit": "f64 rad",
        "integral_limit": "f64 rad/s^2",
    }
    state = {"integral": "f64[2] rad/s^2"}

    def execute(self):
        if self.resumed:
            self.integral = zeros(2)
        q = quat_mul(quat_conj(self.attitude), self.command)
        side = 2.0 if q[0] >= 0.0 else -2.0
        for i in range(3):
            self.error[i] = side * q[1 + i]
        for i in range(2):
            error = clamp(self.error[i], -self.error_limit, self.error_limit)
            if self.flying and not self.limited:
                grown = self.integral[i] + self.k_integral * error * self.dt
                self.integral[i] = clamp(grown, -self.integral_limit, self.integral_limit)
            fast = self.rate_command[i] - self.rate[i]
            self.angular_acceleration[i] = self.k * error + self.k_rate * fast + self.integral[i]


class Actuators:
    """Owns engine, nozzle and roll thrusters.

        throttle = (thrust / factor + back_pressure) / max_thrust
        sin(angle) = u I / (T l),    I = dry_inertia + s full_inertia,    l = pivot - tank p / m

    s is the share of the propellant p that is left. So the loop is the same for every mass and thrust. Roll has a
    switch with hysteresis on error - roll_lead rate: a pair of thrusters each way.

    All is off while `Steering` does not run, and from the first tick without IMU on, for good.
    """

    inputs = {
        "steering_health": "Health",
        "attitude_health": "Health",
        "thrust": "f64 N",
        "factor": "f64",
        "present_thrust": "f64 N",
        "propellant": "f64 kg",
        "mass": "f64 kg",
        "angular_acceleration": "f64[2] rad/s^2",
        "error": "f64[3] rad",
        "rate": "f64[3] rad/s",
        "flying": "bool",
        "imu_valid": "bool",
    }
    outputs = {
        "throttle": "f64",  # 0 to 1
        "nozzle_x": "f64 rad",
        "nozzle_y": "f64 rad",
        "roll_right": "f64",  # 0 or 1: turns it clockwise, seen from above
        "roll_left": "f64",
        "limited": "bool",  # the nozzle is at its end
        "running": "bool",
    }
    parameters = {
        "max_thrust": "f64 N in 1..",
        "back_pressure": "f64 N",
        "min_throttle": "f64",
        "full": "f64 kg in 0.1..",
        "pivot": "f64 m",
        "tank": "f64 m",
        "dry_inertia": "f64 kg*m^2",
        "full_inertia": "f64 kg*m^2",
        "nozzle_limit": "f64 rad",
        "least_thrust": "f64 N in 1..",  # for the angle of the nozzle
        "roll_lead": "f64 s",
        "roll_on": "f64 rad",
        "roll_off": "f64 rad",
    }
    state = {"cut": "bool", "roll": "f64"}

    def execute(self):
        self.running = self.steering_health != "stale" and self.attitude_health != "stale"
        if self.running and not self.imu_valid:
            self.cut = True
        self.running = self.running and not self.cut
        if not self.running:
            self.limited = False
            self.throttle = 0.0
            self.nozzle_x = 0.0
            self.nozzle_y = 0.0
            self.roll = 0.0
        elif commands(self.steering_health) and commands(self.attitude_health):
            self.limited = False
            nozzle = zeros(2)
            throttle = (self.thrust / self.factor + self.back_pressure) / self.max_thrust
            self.throttle = clamp(throttle, self.min_throttle, 1.0)
            inertia = self.dry_inertia + self.full_inertia * self.propellant / self.full
            arm = self.pivot - self.tank * self.propellant / self.mass
            torque = max(self.present_thrust, self.least_thrust) * arm
            for i in range(2):
                angle = asin(clamp(self.angular_acceleration[i] * inertia / torque, -0.9, 0.9))
                nozzle[i] = clamp(angle, -self.nozzle_limit, self.nozzle_limit)
                self.limited = self.limited or abs(angle) > self.nozzle_limit
            ahead = self.error[2] - self.roll_lead * self.rate[2]
            if not self.flying or abs(ahead) < self.roll_off:
                self.roll = 0.0
            elif abs(ahead) > self.roll_on:
                self.roll = 1.0 if ahead > 0.0 else -1.0
            self.nozzle_x, self.nozzle_y = nozzle
        self.roll_right = max(self.roll, 0.0)
        self.roll_left = max(-self.roll, 0.0)
