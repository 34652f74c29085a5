"""The sensors: source blocks, whose outputs channels write, and what checks the IMU."""

from fcsl_builtins import isfinite, min, norm


class Imu:
    """Inertial measurement unit, 100 Hz."""

    outputs = {
        "gyro": "f64[3] rad/s",  # at the time of the sample
        "delta_angle": "f64[3] rad",  # integrals since the sample before
        "delta_velocity": "f64[3] m/s",
    }

    def execute(self):
        pass


class Gnss:
    """Satellite navigation, 10 Hz."""

    outputs = {
        "position": "f64[3] m",  # north, east, down, from the pad
        "velocity": "f64[3] m/s",
    }

    def execute(self):
        pass


class RangeFinder:
    """Laser along the axis of the body, 20 Hz."""

    outputs = {"range": "f64 m"}

    def execute(self):
        pass


class Gauge:
    """Level of the tank, 10 Hz."""

    outputs = {"propellant": "f64 kg"}

    def execute(self):
        pass


class ImuCheck:
    """Whether the IMU can be used: its samples come, are finite, change, and feel a force.

    Noise makes two equal samples rare. The ground or the engine is felt but for a bounce, so an accelerometer that
    measures less than `lightest` for longer is dead.
    """

    inputs = {
        "gyro": "f64[3] rad/s",
        "delta_velocity": "f64[3] m/s",
        "channel_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {"valid": "bool"}
    parameters = {
        "patience": "i32 in 1..",  # ticks with the same sample
        "lightest": "f64 m/s^2",
        "light_patience": "i32 in 1..",  # ticks with less
    }
    state = {"last_gyro": "f64[3] rad/s", "last_delta_velocity": "f64[3] m/s", "same": "i32", "light": "i32"}

    def execute(self):
        change = norm(self.gyro - self.last_gyro) + norm(self.delta_velocity - self.last_delta_velocity)
        self.same = 0 if change > 0.0 else min(self.same + 1, self.patience)
        self.last_gyro = self.gyro
        self.last_delta_velocity = self.delta_velocity
        felt = norm(self.delta_velocity) / self.dt
        self.light = 0 if felt > self.lightest else min(self.light + 1, self.light_patience)
        alive = self.same < self.patience and self.light < self.light_patience
        self.valid = self.channel_valid and isfinite(change) and alive
