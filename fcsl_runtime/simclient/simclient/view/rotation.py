# SPDX-License-Identifier: Apache-2.0
"""Angles of quaternions, for display."""

from __future__ import annotations

import numpy as np

from ..bag import Array

#: Names of the columns of `euler_deg`.
ANGLES = ("roll", "pitch", "yaw")


def euler_deg(q: Array) -> Array:
    """Roll, pitch, yaw (ZYX) in degrees, shape (N, 3), of scalar-first quaternions, shape (N, 4).

    A quaternion of length zero has no angles: NaN.
    """
    w, x, y, z = np.where((q == 0.0).all(axis=1, keepdims=True), np.nan, q.astype(np.float64)).T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(np.stack((roll, pitch, yaw), axis=1))


def unjoined(angles_deg: Array) -> Array:
    """The angles, shape (N,), with a gap where they wrap, so that no line is drawn across."""
    angles = angles_deg.copy()
    angles[1:][np.abs(np.diff(angles_deg)) > 180.0] = np.nan
    return angles
