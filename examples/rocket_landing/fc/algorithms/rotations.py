"""Rotations by small vectors, and the attitude that points the thrust."""

from __future__ import annotations

from fcsl_builtins import cos, cross3, dot, f64, norm, quat_from_axis_angle, quat_mul, quat_normalize, sin

DOWN = [0.0, 0.0, 1.0]


def skew(v: f64[3]) -> f64[3][3]:
    """[v]x, with skew(v) w = v x w."""
    return [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]]


def turned(q: f64[4], turn: f64[3]) -> f64[4]:
    """q, then a rotation by the vector `turn` (rad) in body axes: q (x) exp(turn / 2)."""
    angle = norm(turn)
    if angle == 0.0:
        return q
    return quat_normalize(quat_mul(q, quat_from_axis_angle(turn / angle, angle)))


def pointed(down_body: f64[3], heading: f64) -> f64[4]:
    """The attitude whose z axis is the unit vector `down_body` (NED): a turn by the heading, then the shortest tilt.

    The tilt from z to d is the quaternion (1 + z.d, z x d), normalized. It is singular for a d that points up.
    """
    axis = cross3(DOWN, down_body)
    tilt = quat_normalize([1.0 + dot(DOWN, down_body), axis[0], axis[1], axis[2]])
    return quat_mul(tilt, [cos(0.5 * heading), 0.0, 0.0, sin(0.5 * heading)])
