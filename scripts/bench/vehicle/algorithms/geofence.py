"""Asks for a landing when the vehicle is too far away."""

from fcsl_builtins import sqrt


class Inputs:
    north: f64
    east: f64


class Parameters:
    radius: f64


class Outputs:
    distance: f64


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.distance = sqrt(u.north * u.north + u.east * u.east)
    if y.distance > p.radius:
        y.transition_request = TransitionRequest.LAND
