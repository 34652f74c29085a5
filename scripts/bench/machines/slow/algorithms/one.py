class One:
    """Doubles its input."""

    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = self.x + self.x
