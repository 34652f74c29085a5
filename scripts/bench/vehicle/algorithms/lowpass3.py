"""First-order low-pass filter of a vector: y += gain (x - y)."""


class Inputs:
    x: "f64[3]"


class Parameters:
    gain: f64


class Outputs:
    y: "f64[3]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.y = y.y + p.gain * (u.x - y.y)
