# SPDX-License-Identifier: Apache-2.0
"""Quaternions: scalar first, Hamilton product, unit quaternions turn body coordinates into world coordinates.

Reference: J. Solà, "Quaternion kinematics for the error-state Kalman filter", 2017, §1 and §2.
"""

from fcsl_builtins import asin, atan2, clamp, cos, cross3, norm, sin


def quat_mul(p: "f64[4]", q: "f64[4]") -> "f64[4]":
    """p ⊗ q (Solà eq. 12)."""
    return [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ]


def quat_conj(q: "f64[4]") -> "f64[4]":
    """q*; the inverse of a unit quaternion."""
    return [q[0], -q[1], -q[2], -q[3]]


def quat_normalize(q: "f64[4]") -> "f64[4]":
    """q / ‖q‖; NaN when q is zero."""
    return q / norm(q)


def quat_rotate(q: "f64[4]", v: "f64[3]") -> "f64[3]":
    """q v q* for a unit q, as v + w t + u × t with u = (q₁, q₂, q₃), t = 2 u × v."""
    u = [q[1], q[2], q[3]]
    t = 2.0 * cross3(u, v)
    return v + q[0] * t + cross3(u, t)


def quat_to_dcm(q: "f64[4]") -> "f64[3, 3]":
    """Rotation matrix body → world of a unit q (Solà eq. 115)."""
    w = q[0]
    x = q[1]
    y = q[2]
    z = q[3]
    return [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]


def quat_from_axis_angle(axis: "f64[3]", angle: "f64") -> "f64[4]":
    """Rotation by angle (rad) about a unit axis."""
    s = sin(0.5 * angle)
    return [cos(0.5 * angle), axis[0] * s, axis[1] * s, axis[2] * s]


def quat_from_euler(roll: "f64", pitch: "f64", yaw: "f64") -> "f64[4]":
    """ZYX Euler angles (rad): yaw about z, then pitch about the new y, then roll about the new x."""
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


def quat_to_euler(q: "f64[4]") -> "f64[3]":
    """[roll, pitch, yaw] (rad, ZYX) of a unit q; at pitch ±π/2 roll and yaw are not unique."""
    w = q[0]
    x = q[1]
    y = q[2]
    z = q[3]
    return [
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(clamp(2.0 * (w * y - z * x), -1.0, 1.0)),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    ]
