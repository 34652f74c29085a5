# SPDX-License-Identifier: Apache-2.0
"""Offset and scale of an accelerometer from positions at rest: |scale · (reading - offset)| = g in each of them.

The scale is one factor per axis, so six positions, one with each end of each axis up, determine all six numbers; the vehicle need not
stand exactly upright. With more positions it is a least-squares fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .least_squares import Vector, minimize

GRAVITY = 9.80665


@dataclass(frozen=True)
class AccelFit:
    """`residuals`: |corrected| - g of each position, in m/s^2."""

    offset: Vector
    scale: Vector
    residuals: Vector


def fit_accel(positions: Vector) -> AccelFit:
    """`positions`: mean readings, n × 3 in m/s^2, both ends of each axis among them."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    readings = positions / GRAVITY
    start = np.concatenate([2.0 * GRAVITY / (high - low), (high + low) / (2.0 * GRAVITY)])

    def model(parameters: Vector) -> tuple[Vector, Vector]:
        scale, offset = parameters[:3], parameters[3:]
        centred = readings - offset
        length = np.linalg.norm(scale * centred, axis=1)
        direction = scale * centred / length[:, None]
        return length - 1.0, np.hstack([direction * centred, -direction * scale])

    found = minimize(model, start)
    residuals = model(found)[0] * GRAVITY
    return AccelFit(found[3:] * GRAVITY, found[:3], residuals)


def side_up(mean: Vector) -> tuple[int, int] | None:
    """The axis that points up, and the sign of its end that does; None where none is within 25 degrees."""
    axis = int(np.abs(mean).argmax())
    length = float(np.linalg.norm(mean))
    if length == 0.0 or abs(mean[axis]) < np.cos(np.radians(25.0)) * length:
        return None
    return axis, 1 if mean[axis] > 0.0 else -1
