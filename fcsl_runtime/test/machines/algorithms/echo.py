"""Sums what it is given, and asks for a change of state where the sum is large."""

from fcsl_builtins import TransitionRequest


class Inputs:
    vec: "f64[3]"


class Parameters:
    gain: f64
    fixed: f64


class Outputs:
    sum: f64
    copy: "f64[3]"
    count: u64


class State:
    total: f64


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.sum = p.gain * (u.vec[0] + u.vec[1] + u.vec[2])
    y.copy = u.vec
    x.total += y.sum
    y.count += 1
    if y.sum > 10.0:
        y.transition_request = TransitionRequest.GO
    elif y.sum < -10.0:
        y.transition_request = TransitionRequest.STOP
