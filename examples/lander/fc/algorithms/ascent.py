"""Powered climb at a constant rate, up to engine cut-off at the target altitude.

The throttle follows the estimated velocity. Cut-off is decided on the altimeter itself: it happens in the very tick that
reads past the target, whatever the estimator has seen before. Altimeter noise makes it up to two sigma early, and the
coast that follows carries the vehicle far beyond.
"""

from fcsl_builtins import TransitionRequest, clamp


class Inputs:
    altimeter: "f64 m"  # measured altitude
    altimeter_valid: bool
    vel_z: "f64 m/s"  # estimated velocity


class Parameters:
    target_altitude: "f64 m"
    climb_rate: "f64 m/s"
    gain: "f64 1/s"  # acceleration asked for each m/s of error
    gravity: "f64 m/s^2"
    hover_throttle: f64  # throttle whose thrust is the vehicle's weight


class Outputs:
    throttle: f64  # 0 to 1


def execute(u: Inputs, p: Parameters, y: Outputs) -> None:
    acceleration = p.gain * (p.climb_rate - u.vel_z)
    y.throttle = clamp(p.hover_throttle * (1.0 + acceleration / p.gravity), 0.0, 1.0)
    if u.altimeter_valid and u.altimeter >= p.target_altitude:
        y.throttle = 0.0
        y.transition_request = TransitionRequest.START_COAST
