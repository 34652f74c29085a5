"""Proportional-derivative law that holds a pendulum upright: force = -gain theta - thetadot, within the actuator's limit."""

from fcsl_builtins import clamp


class Inputs:
    theta: "f64 rad"  # angle from upright
    thetadot: "f64 rad/s"  # its rate


class Parameters:
    gain: "f64 N/rad"
    limit: "f64 N"


class Outputs:
    force: "f64 N"  # on the cart, positive to the right


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.force = clamp(-p.gain * u.theta - u.thetadot, -p.limit, p.limit)
