"""The sensors: source blocks, whose outputs channels write, and the check of the gyroscope."""

from fcsl_builtins import cross3, isfinite, max, min, norm


class Gyroscope:
    """Three gyroscopes, 20 Hz."""

    outputs = {
        "rate": "f64[3] rad/s",  # at the time of the sample
        "delta_angle": "f64[3] rad",  # integral since the sample before
    }

    def execute(self):
        pass


class StarTracker:
    """Attitude, 4 Hz, while the satellite turns slowly."""

    outputs = {"attitude": "f64[4]"}  # body to inertial, w, x, y, z

    def execute(self):
        pass


class Magnetometer:
    """Flux density, 20 Hz."""

    outputs = {"field": "f64[3] T"}  # body axes

    def execute(self):
        pass


class Tachometers:
    """The speeds of the four wheels."""

    outputs = {"speed_1": "f64 rad/s", "speed_2": "f64 rad/s", "speed_3": "f64 rad/s", "speed_4": "f64 rad/s"}

    def execute(self):
        pass


class GyroscopeCheck:
    """Whether the gyroscope can be used: its samples come, are finite, change, and agree with the magnetometer.

    A field that stands in space turns in body axes, B' = -w x B. Along an orbit it also turns in space, by up to
    about 0.003 rad/s. With a low pass of time constant `filter_s` on both sides

        mismatch = |low pass of (B' + w x B)| / |B|

    stays below `tolerance` while gyroscope and magnetometer work. The check tells that they disagree, not which of
    the two is wrong; the wheels rest then, until they agree for `recover_s`: a wrong rate along B does not show.
    """

    inputs = {
        "rate": "f64[3] rad/s",
        "field": "f64[3] T",
        "field_valid": "bool",
        "channel_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {"valid": "bool", "mismatch": "f64 rad/s"}
    parameters = {
        "patience": "i32 in 1..",
        "filter_s": "f64 s in 0.1..",
        "tolerance": "f64 rad/s in 0..",
        "recover_s": "f64 s in 0..",
    }
    state = {
        "last_rate": "f64[3] rad/s",
        "last_field": "f64[3] T",
        "slow": "f64[3] T/s",
        "same": "i32",
        "running": "bool",
        "doubt": "f64 s",  # left of recover_s
    }

    def execute(self):
        self.same = 0 if norm(self.rate - self.last_rate) > 0.0 else min(self.same + 1, self.patience)
        self.last_rate = self.rate
        strength = norm(self.field)
        if self.running and self.field_valid and strength > 0.0 and isfinite(strength) and isfinite(norm(self.rate)):
            turn = (self.field - self.last_field) / self.dt + cross3(self.rate, self.field)
            self.slow = self.slow + (turn - self.slow) * (self.dt / self.filter_s)
            self.mismatch = norm(self.slow) / strength
        else:
            self.slow = self.slow * 0.0
            self.mismatch = 0.0
        self.running = self.field_valid and strength > 0.0 and isfinite(strength)
        self.last_field = self.field
        alive = self.channel_valid and isfinite(norm(self.rate)) and self.same < self.patience
        self.doubt = max(self.doubt - self.dt, 0.0) if self.mismatch < self.tolerance else self.recover_s
        self.valid = alive and self.doubt == 0.0
        self.health = "nominal" if self.valid else "failed"


class Monitor:
    """Fails when POINT must not go on: no gyroscope, or an attitude that nobody knows well enough any more."""

    inputs = {"gyroscope_valid": "bool", "known": "bool"}

    def execute(self):
        self.health = "nominal" if self.gyroscope_valid and self.known else "failed"
