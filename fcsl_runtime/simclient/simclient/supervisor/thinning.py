# SPDX-License-Identifier: Apache-2.0
"""Thinning: many ticks as few points to draw, which keep every extreme and the newest value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Thinned:
    """Bins of consecutive rows. A bin of one row is one point; a longer one is two, at its first and its last row."""

    #: First and last row of each bin.
    begins: Array
    ends: Array
    #: Row of each point, rising.
    rows: Array
    #: Numbers of the points that have a gap before them.
    breaks: Array

    def of(self, column: Array) -> Array:
        """The value of each point, from a float64 for each row.

        The two points of a bin are its minimum and maximum, in the order in which its first and last row rise or fall. A
        NaN is left out; a bin of nothing else is NaN.
        """
        lows, highs = np.fmin.reduceat(column, self.begins), np.fmax.reduceat(column, self.begins)
        rises = column[self.ends] >= column[self.begins]
        values = np.empty(len(self.rows))
        first = np.isin(self.rows, self.begins)
        values[first] = np.where(rises, lows, highs)
        values[~first] = np.where(rises, highs, lows)[self.ends > self.begins]
        return values


def thin(gaps: Array, points: int) -> Thinned:
    """Bins for one row or more, of at most `points` (4 or more) points.

    `gaps` is the size of the gap before each row, 0 where there is none. Bins do not reach across the largest gaps. Few
    rows keep a point each.
    """
    count = len(gaps)
    if count <= points:
        begins = np.arange(count)
    else:
        most = (points - 2) // 4
        grid = np.arange(most) * count // most
        at = np.flatnonzero(gaps)
        largest = at[np.argsort(gaps[at])[max(0, len(at) - most) :]]
        begins = np.union1d(np.union1d(grid, largest), [count - 1])
    ends = np.append(begins[1:], count) - 1
    rows = np.union1d(begins, ends)
    return Thinned(begins, ends, rows, np.flatnonzero(np.isin(rows, begins) & (gaps[rows] != 0)))
