"""Sinks at a rate that falls with the altitude."""

from fcsl_builtins import clamp


class Inputs:
    altitude: f64


class Parameters:
    gain: f64
    slowest: f64
    fastest: f64


class Outputs:
    velocity: "f64[3]"


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.velocity = [0.0, 0.0, -clamp(p.gain * u.altitude, p.slowest, p.fastest)]
