"""The sensors and the operator: source blocks. Channels write their outputs."""

from fcsl_builtins import isfinite, min, norm


class Imu:
    """Inertial measurement unit, 250 Hz."""

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
        "position": "f64[3] m",  # north, east, down, from the reference
        "velocity": "f64[3] m/s",
    }

    def execute(self):
        pass


class Barometer:
    """Pressure altitude, 50 Hz."""

    outputs = {"height": "f64 m"}

    def execute(self):
        pass


class Magnetometer:
    """Magnetic flux density in body axes, 25 Hz."""

    outputs = {"field": "f64[3] T"}

    def execute(self):
        pass


class Battery:
    """Voltage of the battery, 50 Hz."""

    outputs = {"voltage": "f64 V"}

    def execute(self):
        pass


class Operator:
    """The radio link: 0 stand, 1 hold, 2 fly the mission, 3 land. No orders for a second: it fails."""

    outputs = {"order": "i32"}

    def execute(self):
        pass


class ImuCheck:
    """Whether the IMU can be used: its samples come, are finite, change, and feel a force.

    Noise makes two equal samples rare. In flight the thrust, on the ground the ground is always felt, so an
    accelerometer that measures less than `lightest` is dead (or the vehicle falls with its motors off).
    """

    inputs = {
        "gyro": "f64[3] rad/s",
        "delta_velocity": "f64[3] m/s",
        "channel_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {"valid": "bool"}
    parameters = {
        "patience": "i32 in 1..",  # ticks with the same sample, or with one that is too light
        "lightest": "f64 m/s^2",
    }
    state = {"last_gyro": "f64[3] rad/s", "last_delta_velocity": "f64[3] m/s", "same": "i32", "light": "i32"}

    def execute(self):
        change = norm(self.gyro - self.last_gyro) + norm(self.delta_velocity - self.last_delta_velocity)
        self.same = 0 if change > 0.0 else min(self.same + 1, self.patience)
        felt = norm(self.delta_velocity) / self.dt
        self.light = 0 if felt > self.lightest else min(self.light + 1, self.patience)
        self.last_gyro = self.gyro
        self.last_delta_velocity = self.delta_velocity
        alive = self.same < self.patience and self.light < self.patience
        self.valid = self.channel_valid and isfinite(change) and alive
