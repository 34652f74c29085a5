"""PI control of the velocity, with clamped integrals."""

from fcsl_builtins import clamp


class Inputs:
    target: "f64[3]"
    north: f64
    east: f64
    up: f64


class Parameters:
    kp: f64
    ki: f64
    limit: f64
    period: "f64 s"


class Outputs:
    accel: "f64[3]"


class State:
    integral: "f64[3]"


def execute(u: Inputs, p: Parameters, x: State, y: Outputs) -> None:
    error = u.target - [u.north, u.east, u.up]
    for i in range(3):
        x.integral[i] = clamp(x.integral[i] + p.ki * p.period * error[i], -p.limit, p.limit)
        y.accel[i] = p.kp * error[i] + x.integral[i]
