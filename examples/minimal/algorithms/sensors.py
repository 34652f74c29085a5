class Sensors:
    """A source block: its outputs are written by the host, a test or a driver."""

    outputs = {
        "theta": "f64 rad",  # angle from upright
        "thetadot": "f64 rad/s",  # its rate
    }

    def execute(self):
        pass
