from fcsl_builtins import abs, clamp, floor, sign


class RollAutopilot:
    """Holds a roll angle, or that which turns to a heading, by the aileron. Angles in degrees.

    The roll reference is that of the turn knob where it is used; else what was latched in the last tick before the
    autopilot was engaged.
    """

    inputs = {
        "engaged": "bool",
        "heading_mode": "bool",
        "heading_reference": "f64 deg",
        "turn_knob": "f64 deg",
        "roll": "f64 deg",
        "heading": "f64 deg",
        "roll_rate": "f64 deg/s",
        "airspeed": "f64",
    }
    outputs = {"aileron": "f64", "reference": "f64 deg", "heading_command": "f64 deg", "command": "f64 deg"}
    state = {"latched": "f64 deg", "integral": "f64"}

    def execute(self):
        self.reference = self.latched if abs(self.turn_knob) < 3.0 else self.turn_knob
        if not self.engaged:
            self.latched = 0.0 if abs(self.roll) < 6.0 else self.roll
        turn = self.heading_reference - self.heading
        turn -= sign(turn) * floor((abs(turn) + 180.0) / 360.0) * 360.0
        self.heading_command = turn * 0.015 * self.airspeed
        self.command = self.heading_command if self.heading_mode else self.reference
        rate = clamp(clamp(self.command, -30.0, 30.0) - self.roll, -6.0, 6.0) - self.roll_rate
        self.integral = clamp(self.integral, -5.0, 5.0) if self.engaged else 0.0
        self.aileron = clamp(self.integral + 3.0 * rate, -15.0, 15.0) if self.engaged else 0.0
        self.integral += 0.025 * rate
