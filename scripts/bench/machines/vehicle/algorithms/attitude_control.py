from fcsl_builtins import quat_conj, quat_mul


class AttitudeControl:
    """The body rate that turns the attitude to its target, in proportion to the angle between."""

    inputs = {"q": "f64[4]", "target": "f64[4]", "sticks": "f64[4]"}
    outputs = {"rate": "f64[3]"}
    parameters = {"gain": "f64[3]", "yaw_rate": "f64"}

    def execute(self):
        e = quat_mul(quat_conj(self.q), self.target)
        s = 2.0 if e[0] >= 0.0 else -2.0
        self.rate = [
            s * self.gain[0] * e[1],
            s * self.gain[1] * e[2],
            s * self.gain[2] * e[3] + self.yaw_rate * self.sticks[3],
        ]
