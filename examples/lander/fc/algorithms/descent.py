"""Powered descent along a velocity profile, touchdown detection, engine off.

Above `final_altitude` the vehicle brakes with the constant deceleration `brake` down to `touchdown_speed` (the profile of
coast.py), below it sinks at that speed. It has landed when, close to the ground, it has stood still for `still_time`
although told to sink, or when the estimate lies `burial_depth` under the ground: then there is no doubt left.
"""

from fcsl_builtins import abs, clamp, max, sqrt


class Inputs:
    pos_z: "f64 m"  # estimates
    vel_z: "f64 m/s"
    dt: "f64 s"


class Parameters:
    brake: "f64 m/s^2"
    touchdown_speed: "f64 m/s"
    final_altitude: "f64 m"
    gain: "f64 1/s"  # acceleration asked for each m/s of error
    gravity: "f64 m/s^2"
    hover_throttle: f64  # throttle whose thrust is the vehicle's weight
    ground_altitude: "f64 m"  # below it, the vehicle may be standing on the ground
    still_time: "f64 s"
    burial_depth: "f64 m"


class Outputs:
    throttle: f64  # 0 to 1
    target_velocity: "f64 m/s"
    landed: bool


class State:
    still: "f64 s"  # how long the vehicle has not moved


def execute(u: Inputs, p: Parameters, s: State, y: Outputs) -> None:
    height = max(u.pos_z - p.final_altitude, 0.0)
    y.target_velocity = -sqrt(p.touchdown_speed * p.touchdown_speed + 2.0 * p.brake * height)
    acceleration = p.gain * (y.target_velocity - u.vel_z)
    if height > 0.0:
        acceleration += p.brake
    y.throttle = clamp(p.hover_throttle * (1.0 + acceleration / p.gravity), 0.0, 1.0)

    still = u.pos_z < p.ground_altitude and abs(u.vel_z) < 0.5 * p.touchdown_speed
    s.still = s.still + u.dt if still else 0.0
    if s.still > p.still_time or u.pos_z < -p.burial_depth:
        y.landed = True
    if y.landed:
        y.throttle = 0.0
