"""The attitude that points the thrust."""

from __future__ import annotations

from fcsl_builtins import cos, cross3, dot, f64, quat_mul, quat_normalize, sin

DOWN = [0.0, 0.0, 1.0]


def pointed(down_body: f64[3], yaw: f64) -> f64[4]:
    """The attitude whose z axis is the unit vector `down_body` (NED): a turn by yaw, then the shortest tilt to it.

    The tilt from z to d is the quaternion (1 + z.d, z x d), normalized. It is singular for a d that points up.
    """
    axis = cross3(DOWN, down_body)
    tilt = quat_normalize([1.0 + dot(DOWN, down_body), axis[0], axis[1], axis[2]])
    return quat_mul(tilt, [cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)])
