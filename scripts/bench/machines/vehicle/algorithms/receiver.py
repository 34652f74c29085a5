class Receiver:
    """The pilot's radio: a source block."""

    outputs = {
        "sticks": "f64[4]",  # north, east, up and yaw, each in [-1, 1]
        "mode": "f64",  # above 0.5: land
    }

    def execute(self):
        pass
