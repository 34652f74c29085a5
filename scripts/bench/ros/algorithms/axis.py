"""One axis of the rig: follows a sine with a PD law, against a plant of its own. plain_node.py does the same."""

from fcsl_builtins import clamp, sin


class Inputs:
    dt: "f64 s"


class Parameters:
    frequency: "f64 rad/s"


class State:
    phase: "f64 rad"


class Outputs:
    reference: "f64 rad"
    position: "f64 rad"
    speed: "f64 rad/s"
    torque: "f64 N*m"
    saturated: bool


def execute(u: Inputs, p: Parameters, s: State, y: Outputs) -> None:
    s.phase += p.frequency * u.dt
    y.reference = sin(s.phase)
    wanted = 400.0 * (y.reference - y.position) - 40.0 * y.speed
    y.torque = clamp(wanted, -50.0, 50.0)
    y.saturated = y.torque != wanted
    y.speed += y.torque * u.dt
    y.position += y.speed * u.dt
