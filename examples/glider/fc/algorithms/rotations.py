"""Rotations by small vectors."""

from __future__ import annotations

from fcsl_builtins import f64, norm, quat_from_axis_angle, quat_mul, quat_normalize


def skew(v: f64[3]) -> f64[3][3]:
    """[v]x, with skew(v) w = v x w."""
    return [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]]


def turned(q: f64[4], turn: f64[3]) -> f64[4]:
    """q, then a rotation by the vector `turn` (rad) in body axes: q (x) exp(turn / 2)."""
    angle = norm(turn)
    if angle == 0.0:
        return q
    return quat_normalize(quat_mul(q, quat_from_axis_angle(turn / angle, angle)))
