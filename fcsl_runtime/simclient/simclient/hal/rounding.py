# SPDX-License-Identifier: Apache-2.0
"""Numbers as they are written into a board."""

from __future__ import annotations

from typing import Any

from .least_squares import Vector


def rounded(values: Vector) -> Any:
    """Lists with seven digits of each number: more than any sensor has."""
    if values.ndim > 1:
        return [rounded(row) for row in values]
    return [float(f"{value:.7g}") for value in values]
