# SPDX-License-Identifier: Apache-2.0
"""Ranges of the channels of a remote control, from pulses at rest and pulses of sticks that are moved to all their ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .least_squares import Vector

#: A channel that moves less was not moved.
MOVED_US = 200.0
#: Of the noise at rest, so that a stick at rest is 0.
_NOISE_FACTOR, _DEADBAND_MIN_US = 1.5, 2.0
#: A channel that rests so near to an end, as a part of its range, has no middle of its own: a switch, or a throttle.
_NEAR_END = 0.2


@dataclass(frozen=True)
class Range:
    """In us. `middle` is at rest, or half-way for what rests at an end."""

    minimum: float
    middle: float
    maximum: float
    deadband: float


def fit_ranges(rest: Vector, moved: Vector) -> list[Range | None]:
    """`rest`, `moved`: samples × channels. None for a channel that was not moved."""
    return [_range(rest[:, channel], moved[:, channel]) for channel in range(rest.shape[1])]


def _range(rest: Vector, moved: Vector) -> Range | None:
    low, high = float(np.floor(moved.min())), float(np.ceil(moved.max()))
    if high - low < MOVED_US:
        return None
    middle = float(np.round(np.median(rest)))
    margin = _NEAR_END * (high - low)
    if not low + margin < middle < high - margin:
        return Range(low, (low + high) / 2.0, high, 0.0)
    noise = float(np.abs(rest - middle).max())
    return Range(low, middle, high, float(max(_DEADBAND_MIN_US, math.ceil(_NOISE_FACTOR * noise))))
