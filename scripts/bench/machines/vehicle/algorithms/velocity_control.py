from fcsl_builtins import clamp


class VelocityControl:
    """PI control of the velocity, with clamped integrals."""

    inputs = {"target": "f64[3]", "north": "f64", "east": "f64", "up": "f64"}
    outputs = {"accel": "f64[3]"}
    parameters = {"kp": "f64", "ki": "f64", "limit": "f64", "period": "f64 s"}
    state = {"integral": "f64[3]"}

    def execute(self):
        error = self.target - [self.north, self.east, self.up]
        for i in range(3):
            self.integral[i] = clamp(self.integral[i] + self.ki * self.period * error[i], -self.limit, self.limit)
            self.accel[i] = self.kp * error[i] + self.integral[i]
