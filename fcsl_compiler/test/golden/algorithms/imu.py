class Imu:
    """A source block: a channel and a host write its outputs."""

    outputs = {
        "rate": "f64[3] rad/s",  # about the body axes
        "armed": "bool",
    }

    def execute(self):
        pass
