"""From an acceleration to a thrust and the attitude that points it there, the shortest way from upright."""

from fcsl_builtins import clamp, norm, quat_normalize


class Inputs:
    accel: "f64[3]"


class Parameters:
    hover: f64  # thrust that is the weight


class Outputs:
    thrust: f64
    q: "f64[4]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    force = u.accel + [0.0, 0.0, 9.80665]
    size = norm(force)
    y.thrust = clamp(p.hover * size / 9.80665, 0.0, 1.0)
    if size > 0.1:
        d = force / size
        y.q = quat_normalize([1.0 + d[2], -d[1], d[0], 0.0])
    else:
        y.q = [1.0, 0.0, 0.0, 0.0]
