"""PID control of one body rate, derivative on the measurement and filtered; `axis` chooses which."""

from fcsl_builtins import clamp


class Inputs:
    target: "f64[3]"
    rate: "f64[3]"
    dt: "f64 s"


class Parameters:
    axis: i32
    kp: f64
    ki: f64
    kd: f64
    limit: f64
    smooth: f64


class Outputs:
    torque: f64


class State:
    integral: f64
    before: f64
    slope: f64


def execute(u: Inputs, p: Parameters, x: State, y: Outputs) -> None:
    rate = u.rate[p.axis]
    error = u.target[p.axis] - rate
    x.integral = clamp(x.integral + p.ki * u.dt * error, -p.limit, p.limit)
    x.slope = x.slope + p.smooth * ((rate - x.before) / u.dt - x.slope)
    x.before = rate
    y.torque = clamp(p.kp * error + x.integral - p.kd * x.slope, -1.0, 1.0)
