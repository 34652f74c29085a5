from fcsl_builtins import clamp


class Motor:
    """One motor: a limited slew, and off when the command is."""

    inputs = {"motors": "f64[4]"}
    outputs = {"command": "f64"}
    parameters = {
        "number": "i32",
        "slew": "f64",  # greatest change in a tick
    }

    def execute(self):
        wanted = self.motors[self.number]
        self.command = self.command + clamp(wanted - self.command, -self.slew, self.slew)
