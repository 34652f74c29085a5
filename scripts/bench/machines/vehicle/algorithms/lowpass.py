class Lowpass:
    """First-order low-pass filter: y += gain (x - y)."""

    inputs = {"x": "f64"}
    outputs = {"y": "f64"}
    parameters = {"gain": "f64"}

    def execute(self):
        self.y = self.y + self.gain * (self.x - self.y)
