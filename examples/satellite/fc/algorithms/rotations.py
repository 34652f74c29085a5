"""Small turns of quaternions."""

from __future__ import annotations

from fcsl_builtins import atan2, cos, f64, norm, quat_mul, quat_normalize, sin, sqrt

SMALL = 1e-12  # rad


def turned(q: f64[4], angle: f64[3]) -> f64[4]:
    """q turned further by a rotation vector in body axes."""
    size = norm(angle)
    half = 0.5 * size
    factor = 0.5 if size < SMALL else sin(half) / size
    turn = [cos(half), factor * angle[0], factor * angle[1], factor * angle[2]]
    return quat_normalize(quat_mul(q, turn))


def rotation_vector(q: f64[4]) -> f64[3]:
    """The rotation vector of a quaternion, by the shorter way: at most pi long."""
    way = -1.0 if q[0] < 0.0 else 1.0
    sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    factor = 2.0 * way if sine < SMALL else 2.0 * way * atan2(sine, way * q[0]) / sine
    return [factor * q[1], factor * q[2], factor * q[3]]
