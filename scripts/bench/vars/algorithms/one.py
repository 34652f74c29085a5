"""Doubles its input."""


class Inputs:
    x: "f64"


class Outputs:
    y: "f64"


def execute(u: Inputs, y: Outputs) -> None:
    y.y = u.x + u.x
