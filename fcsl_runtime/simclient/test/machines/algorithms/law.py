class Law:
    """Computes from what `io` has read."""

    inputs = {"total": "f64"}
    outputs = {"out": "f64"}

    def execute(self):
        self.out += self.total
