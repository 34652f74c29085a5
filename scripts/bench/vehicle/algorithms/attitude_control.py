"""The body rate that turns the attitude to its target, in proportion to the angle between."""

from fcsl_builtins import quat_conj, quat_mul


class Inputs:
    q: "f64[4]"
    target: "f64[4]"
    sticks: "f64[4]"


class Parameters:
    gain: "f64[3]"
    yaw_rate: f64


class Outputs:
    rate: "f64[3]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    e = quat_mul(quat_conj(u.q), u.target)
    s = 2.0 if e[0] >= 0.0 else -2.0
    y.rate = [s * p.gain[0] * e[1], s * p.gain[1] * e[2], s * p.gain[2] * e[3] + p.yaw_rate * u.sticks[3]]
