"""The pilot's sticks are velocities."""


class Inputs:
    sticks: "f64[4]"


class Parameters:
    speed: f64


class Outputs:
    velocity: "f64[3]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.velocity = p.speed * u.sticks[0:3]
