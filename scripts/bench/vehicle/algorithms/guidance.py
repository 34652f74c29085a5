"""Flies a closed tour of waypoints at a constant speed."""

from fcsl_builtins import norm

COUNT = 4


class Inputs:
    north: f64
    east: f64
    up: f64


class Parameters:
    waypoints: "f64[COUNT, 3]"
    speed: f64
    reach: f64  # a waypoint nearer than this is passed


class Outputs:
    velocity: "f64[3]"


class State:
    next: u32


def execute(u: Inputs, p: Parameters, x: State, y: Outputs) -> None:
    to = p.waypoints[x.next] - [u.north, u.east, u.up]
    distance = norm(to)
    if distance < p.reach:
        x.next = (x.next + 1) % COUNT
        y.velocity = [0.0, 0.0, 0.0]
    else:
        y.velocity = to * (p.speed / distance)
