class Gps:
    """The satellite receiver: a source block."""

    outputs = {
        "position": "f64[3] m",  # north, east, up of the start
        "velocity": "f64[3] m/s",
        "accuracy": "f64 m",
    }

    def execute(self):
        pass
