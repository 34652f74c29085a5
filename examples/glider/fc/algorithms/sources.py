"""The sensors: source blocks, whose outputs channels write. And what the airspeed sensor is worth."""

from fcsl_builtins import isfinite, max, min, sqrt


class Imu:
    """Inertial measurement unit, 50 Hz."""

    outputs = {
        "gyro": "f64[3] rad/s",  # at the time of the sample
        "delta_angle": "f64[3] rad",  # integrals since the sample before
        "delta_velocity": "f64[3] m/s",
    }

    def execute(self):
        pass


class Gnss:
    """Satellite navigation, 5 Hz."""

    outputs = {
        "position": "f64[3] m",  # north, east, down, from the reference
        "velocity": "f64[3] m/s",
    }

    def execute(self):
        pass


class Barometer:
    """Pressure altitude, 25 Hz."""

    outputs = {"height": "f64 m"}

    def execute(self):
        pass


class Pitot:
    """Dynamic pressure, 50 Hz."""

    outputs = {"pressure": "f64 Pa"}

    def execute(self):
        pass


class Airspeed:
    """The airspeed of the pitot tube: V = sqrt(2 pressure / density). It is not valid while the tube is silent or
    repeats itself: the noise of a tube that works makes two equal samples rare.
    """

    inputs = {"pressure": "f64 Pa", "channel_valid": "bool", "fresh": "bool"}
    outputs = {"airspeed": "f64 m/s", "valid": "bool"}
    parameters = {
        "density": "f64 kg/m^3 in 0.1..",
        "patience": "i32 in 1..",  # equal samples
    }
    state = {"last": "f64 Pa", "same": "i32"}

    def execute(self):
        if self.fresh:
            self.same = min(self.same + 1, self.patience) if self.pressure == self.last else 0
            self.last = self.pressure
        self.valid = self.channel_valid and isfinite(self.pressure) and self.same < self.patience
        if self.valid:
            self.airspeed = sqrt(2.0 * max(self.pressure, 0.0) / self.density)
