"""How far two attitudes disagree in tilt: the angle between what each takes for up. Yaw does not enter.

With up = R^T [0, 0, 1] of each, the angle is atan2(|up1 x up2|, up1 . up2), exact for small angles too.
"""

from fcsl_builtins import Health, atan2, cross3, dot, norm, quat_conj, quat_rotate, sqrt

UP = [0.0, 0.0, 1.0]


class Inputs:
    orientation: "f64[4]"  # unit quaternions w, x, y, z, body to world
    reference: "f64[4]"  # zero while there is none


class Outputs:
    tilt_error: "f64 rad"
    tilt_error_rms: "f64 rad"  # since the first reference


class State:
    squares: "f64 rad^2"  # sum over the ticks compared
    ticks: f64


def execute(u: Inputs, s: State, y: Outputs) -> None:
    if norm(u.reference) > 0.5:
        up = quat_rotate(quat_conj(u.orientation), UP)
        up_reference = quat_rotate(quat_conj(u.reference), UP)
        y.tilt_error = atan2(norm(cross3(up, up_reference)), dot(up, up_reference))
        s.squares += y.tilt_error * y.tilt_error
        s.ticks += 1.0
        y.tilt_error_rms = sqrt(s.squares / s.ticks)
    else:
        y.health = Health.degraded
