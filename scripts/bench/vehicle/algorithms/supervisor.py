"""Asks for a landing when the pilot or the battery does; below 1 V there is no battery."""


class Inputs:
    switch: f64
    voltage: f64


class Parameters:
    empty: "f64"


class Outputs:
    low: bool


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    y.low = 1.0 < u.voltage < p.empty
    if y.low or u.switch > 0.5:
        y.transition_request = TransitionRequest.LAND
    elif u.switch < -0.5:
        y.transition_request = TransitionRequest.HOLD
