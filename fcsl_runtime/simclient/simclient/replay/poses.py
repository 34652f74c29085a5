# SPDX-License-Identifier: Apache-2.0
"""Arrays of poses: composed, inverted, interpolated.

A pose of frame B in frame A is the origin of B in axes of A, `position` of shape (n, 3), and the rotation that turns
vectors from axes of B into axes of A, `rotation` of shape (n, 4): a unit quaternion x, y, z, w as in ROS.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .tick_alignment import Array


class Poses(NamedTuple):
    """n poses, or one for all times (n = 1)."""

    position: Array
    rotation: Array


def are_rotations(quaternions: Array) -> Array:
    """Which of n quaternions, shape (n, 4), are rotations: their length is neither zero nor infinite nor NaN."""
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(quaternions, axis=1)
    sound: Array = (length > 0) & np.isfinite(length)
    return sound


def identity() -> Poses:
    return Poses(np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]]))


def compose(first: Poses, second: Poses) -> Poses:
    """The pose of C in A, from `first`, of B in A, and `second`, of C in B."""
    position = first.position + _rotated(first.rotation, second.position)
    return Poses(position, _product(first.rotation, second.rotation))


def inverse(poses: Poses) -> Poses:
    """The pose of A in B, from that of B in A."""
    back = poses.rotation * (-1.0, -1.0, -1.0, 1.0)
    return Poses(-_rotated(back, poses.position), back)


def interpolate(times_ns: Array, poses: Poses, at_ns: Array) -> Poses:
    """The poses at `at_ns`, from those at `times_ns` (strictly ascending, shape (n,)): the position linearly, the
    rotation on the shorter great arc (slerp), as tf2 does. `at_ns` must lie within `times_ns`.
    """
    after = np.searchsorted(times_ns, at_ns)
    before = np.maximum(after - 1, 0)
    span = np.where(after > before, times_ns[after] - times_ns[before], 1)
    part = np.where(after > before, (at_ns - times_ns[before]) / span, 1.0)[:, None]
    position = poses.position[before] * (1.0 - part) + poses.position[after] * part
    return Poses(position, _slerp(poses.rotation[before], poses.rotation[after], part))


def _slerp(p: Array, q: Array, part: Array) -> Array:
    q = np.where((p * q).sum(axis=1, keepdims=True) < 0.0, -q, q)
    # The angle between p and q, at most 90 degrees; accurate also where it is small.
    angle = 2.0 * np.arctan2(np.linalg.norm(q - p, axis=1), np.linalg.norm(q + p, axis=1))[:, None] / np.pi
    # sin(f a) / sin(a) for the two parts f; np.sinc(x) = sin(pi x) / (pi x) is 1 at 0.
    weights = [f * np.sinc(f * angle) / np.sinc(angle) for f in (1.0 - part, part)]
    between: Array = weights[0] * p + weights[1] * q
    return between / np.linalg.norm(between, axis=1, keepdims=True)


def _product(p: Array, q: Array) -> Array:
    vector = p[:, 3:] * q[:, :3] + q[:, 3:] * p[:, :3] + np.cross(p[:, :3], q[:, :3])
    scalar = p[:, 3:] * q[:, 3:] - (p[:, :3] * q[:, :3]).sum(axis=1, keepdims=True)
    return np.concatenate((vector, scalar), axis=1)


def _rotated(rotation: Array, vectors: Array) -> Array:
    """v + 2 w (u × v) + 2 u × (u × v) for the quaternion (u, w)."""
    across = 2.0 * np.cross(rotation[:, :3], vectors)
    turned: Array = vectors + rotation[:, 3:] * across + np.cross(rotation[:, :3], across)
    return turned
