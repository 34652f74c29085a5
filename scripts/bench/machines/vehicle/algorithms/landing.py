from fcsl_builtins import clamp


class Landing:
    """Sinks at a rate that falls with the altitude."""

    inputs = {"altitude": "f64"}
    outputs = {"velocity": "f64[3]"}
    parameters = {"gain": "f64", "slowest": "f64", "fastest": "f64"}

    def execute(self):
        self.velocity = [0.0, 0.0, -clamp(self.gain * self.altitude, self.slowest, self.fastest)]
