from fcsl_builtins import clamp


class Mixer:
    """From thrust and torques to the four motors of a quadrotor in X; torque yields to thrust."""

    inputs = {"thrust": "f64", "roll": "f64", "pitch": "f64", "yaw": "f64"}
    outputs = {"motors": "f64[4]"}
    parameters = {"share": "f64[4][3]"}  # of each torque in each motor

    def execute(self):
        for i in range(4):
            self.motors[i] = clamp(
                self.thrust
                + self.share[i, 0] * self.roll
                + self.share[i, 1] * self.pitch
                + self.share[i, 2] * self.yaw,
                0.0,
                1.0,
            )
