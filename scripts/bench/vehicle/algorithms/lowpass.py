"""First-order low-pass filter: y += gain (x - y)."""


class Inputs:
    x: f64


class Parameters:
    gain: f64


class Outputs:
    y: f64


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.y = y.y + p.gain * (u.x - y.y)
