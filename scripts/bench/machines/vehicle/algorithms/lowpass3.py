class Lowpass3:
    """First-order low-pass filter of a vector: y += gain (x - y)."""

    inputs = {"x": "f64[3]"}
    outputs = {"y": "f64[3]"}
    parameters = {"gain": "f64"}

    def execute(self):
        self.y = self.y + self.gain * (self.x - self.y)
