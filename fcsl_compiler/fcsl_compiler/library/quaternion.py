# SPDX-License-Identifier: Apache-2.0
"""Quaternions: scalar first, Hamilton product, unit quaternions turn body coordinates into world coordinates.

Reference: J. Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, §1 and §2.
"""

from fcsl_builtins import asin, atan2, clamp, cos, cross3, dot, norm, sin


def quat_mul(p: "F[4]", q: "F[4]") -> "F[4]":
    """p ⊗ q, the Hamilton product: the rotation q, then p.

    Source: Solà eq. 12.
    Order: each element is the sum of its four products from left to right, in the order of p₀, p₁, p₂, p₃.
    Singular: none.
    """
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ]


def quat_conj(q: "F[4]") -> "F[4]":
    """q* = (q₀, −q₁, −q₂, −q₃); the inverse of a unit quaternion.

    Source: Solà §1.2.
    Order: exact.
    Singular: none.
    """
    return [q[0], -q[1], -q[2], -q[3]]


def quat_normalize(q: "F[4]") -> "F[4]":
    """q / ‖q‖.

    Order: norm(q), then each element divided by it.
    Singular: NaN when q is zero.
    """
    return q / norm(q)


def quat_rotate(q: "F[4]", v: "F[3]") -> "F[3]":
    """q v q* for a unit q: body coordinates v in the world.

    Source: Solà §2.4, with the product multiplied out.
    Order: u = (q₁, q₂, q₃), t = 2 (u × v), then (v + q₀ t) + u × t.
    Singular: a q that is not of unit length scales and shears; normalize it.
    """
    u = [q[1], q[2], q[3]]
    t = 2.0 * cross3(u, v)
    return v + q[0] * t + cross3(u, t)


def quat_to_dcm(q: "F[4]") -> "F[3][3]":
    """Rotation matrix body → world of a unit q: quat_to_dcm(q) v = quat_rotate(q, v).

    Source: Solà eq. 115, with 1 − 2 (…) on the diagonal.
    Order: in each element the two products first, then their sum or difference, doubled, and 1 − that on the diagonal.
    Singular: of a q that is not of unit length it is no rotation; normalize it.
    """
    w = q[0]
    x = q[1]
    y = q[2]
    z = q[3]
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]


def quat_from_axis_angle(axis: "F[3]", angle: "F") -> "F[4]":
    """Rotation by angle (rad) about a unit axis: (cos(angle/2), axis sin(angle/2)).

    Source: Solà §2.4.
    Order: s = sin(0.5 angle), then each element of the axis times s.
    Singular: none; the axis is not normalized.
    """
    s = sin(0.5 * angle)
    return [cos(0.5 * angle), axis[0] * s, axis[1] * s, axis[2] * s]


def quat_turn(q: "F[4]", turn: "F[3]") -> "F[4]":
    """q ⊗ exp(turn / 2): the rotation q, turned further by the rotation vector turn (rad, in body axes).

    Source: Solà §2.4.
    Order: angle = norm(turn), then quat_normalize(quat_mul(q, quat_from_axis_angle(turn / angle, angle))).
    Singular: q as it is where the angle is exactly 0.
    """
    angle = norm(turn)
    if angle == 0.0:
        return q
    return quat_normalize(quat_mul(q, quat_from_axis_angle(turn / angle, angle)))


def quat_from_euler(roll: "F", pitch: "F", yaw: "F") -> "F[4]":
    """ZYX Euler angles (rad): yaw about z, then pitch about the new y, then roll about the new x.

    Source: the product of the three half-angle quaternions, yaw ⊗ pitch ⊗ roll, multiplied out.
    Order: c and s of half of each angle; each element is (roll · pitch) · yaw of the one triple ± that of the other.
    Singular: none.
    """
    cr = cos(0.5 * roll)
    sr = sin(0.5 * roll)
    cp = cos(0.5 * pitch)
    sp = sin(0.5 * pitch)
    cy = cos(0.5 * yaw)
    sy = sin(0.5 * yaw)
    return [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]


def quat_to_euler(q: "F[4]") -> "F[3]":
    """[roll, pitch, yaw] (rad, ZYX) of a unit q.

    Source: the elements of quat_to_dcm(q) compared with those of the product of the three rotations.
    Order: the elements in quat_to_dcm's order of operations, then atan2, asin (of a clamped argument), atan2.
    Singular: at pitch ±π/2 roll and yaw are not unique: only their sum or difference means something there, and near it
    they lose digits as 1/cos(pitch).
    """
    w = q[0]
    x = q[1]
    y = q[2]
    z = q[3]
    return [
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(clamp(2.0 * (w * y - z * x), -1.0, 1.0)),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]


def quat_slerp(p: "F[4]", q: "F[4]", t: "F") -> "F[4]":
    """The rotation at t on the shortest way from p (t = 0) to q (t = 1), at constant rate; p and q are of unit length.

    Source: K. Shoemake, "Animating rotation with quaternion curves", 1985; the angle as W. Kahan takes it, which keeps
    its digits where the arc cosine of p·q has lost them.
    Order: q is negated where p·q < 0; θ = 2 atan2(‖q − p‖, ‖q + p‖), s = sin θ;
    (sin((1 − t) θ) / s) p + (sin(t θ) / s) q.
    Singular: p where θ is exactly 0 (p and q are the same rotation); where p·q is 0 there are two shortest ways, and q is
    taken as it is. t beyond [0, 1] goes on along the same circle.
    """
    near = q
    if dot(p, q) < 0.0:
        near = -q
    theta = 2.0 * atan2(norm(near - p), norm(near + p))
    if theta == 0.0:
        return p
    s = sin(theta)
    return (sin((1.0 - t) * theta) / s) * p + (sin(t * theta) / s) * near
