class Battery:
    """The battery's sensor: a source block."""

    outputs = {"voltage": "f64 V"}

    def execute(self):
        pass
