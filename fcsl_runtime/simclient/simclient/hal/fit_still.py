# SPDX-License-Identifier: Apache-2.0
"""The mean of a device at rest, and how much it moved."""

from __future__ import annotations

from dataclasses import dataclass

from .least_squares import Vector


@dataclass(frozen=True)
class Still:
    """Mean and standard deviation of each axis."""

    mean: Vector
    deviation: Vector


def fit_still(samples: Vector) -> Still:
    """`samples`: n × 3, n from 2 on."""
    return Still(samples.mean(axis=0), samples.std(axis=0, ddof=1))
