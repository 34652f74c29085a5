class AxisFilter:
    """Alpha-beta filter of one horizontal axis of the position; `axis` chooses it."""

    inputs = {"fix_position": "f64[3] m", "fix_velocity": "f64[3] m/s", "accuracy": "f64 m", "accel": "f64[3]"}
    outputs = {"position": "f64", "velocity": "f64"}
    parameters = {
        "axis": "i32",
        "period": "f64 s",
        "alpha": "f64",
        "beta": "f64",
        "worst": "f64 m",  # accuracy beyond which a fix is not used
    }

    def execute(self):
        a = self.accel[self.axis]
        self.position = self.position + self.period * self.velocity + 0.5 * self.period * self.period * a
        self.velocity = self.velocity + self.period * a
        if self.accuracy < self.worst:
            self.position = self.position + self.alpha * (self.fix_position[self.axis] - self.position)
            self.velocity = self.velocity + self.beta * (self.fix_velocity[self.axis] - self.velocity)
        else:
            self.health = "degraded"
