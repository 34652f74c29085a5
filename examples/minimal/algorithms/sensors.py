"""A source block: its outputs are written by the host, a test or a driver."""


class Outputs:
    theta: "f64 rad"  # angle from upright
    thetadot: "f64 rad/s"  # its rate


def execute() -> None:
    pass
