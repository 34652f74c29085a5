from fcsl_builtins import clamp, sin


class Axis:
    """One axis of the rig: follows a sine with a PD law, against a plant of its own. plain_node.py does the same."""

    inputs = {"dt": "f64 s"}
    outputs = {
        "reference": "f64 rad",
        "position": "f64 rad",
        "speed": "f64 rad/s",
        "torque": "f64 N*m",
        "saturated": "bool",
    }
    parameters = {"frequency": "f64 rad/s"}
    state = {"phase": "f64 rad"}

    def execute(self):
        self.phase += self.frequency * self.dt
        self.reference = sin(self.phase)
        wanted = 400.0 * (self.reference - self.position) - 40.0 * self.speed
        self.torque = clamp(wanted, -50.0, 50.0)
        self.saturated = self.torque != wanted
        self.speed += self.torque * self.dt
        self.position += self.speed * self.dt
