from fcsl_builtins import clamp


class RateControl:
    """PID control of one body rate, derivative on the measurement and filtered; `axis` chooses which."""

    inputs = {"target": "f64[3]", "rate": "f64[3]", "dt": "f64 s"}
    outputs = {"torque": "f64"}
    parameters = {"axis": "i32", "kp": "f64", "ki": "f64", "kd": "f64", "limit": "f64", "smooth": "f64"}
    state = {"integral": "f64", "before": "f64", "slope": "f64"}

    def execute(self):
        rate = self.rate[self.axis]
        error = self.target[self.axis] - rate
        self.integral = clamp(self.integral + self.ki * self.dt * error, -self.limit, self.limit)
        self.slope = self.slope + self.smooth * ((rate - self.before) / self.dt - self.slope)
        self.before = rate
        self.torque = clamp(self.kp * error + self.integral - self.kd * self.slope, -1.0, 1.0)
