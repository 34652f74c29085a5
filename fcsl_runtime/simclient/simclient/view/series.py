# SPDX-License-Identifier: Apache-2.0
"""Values over time: where messages are missing, the newest value at a time, fewer samples with the same extremes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..bag import Array
from .signals import UNKNOWN

#: A message that comes later than this many usual steps after the last one has a gap before it.
_LATE = 1.5


class Gaps:
    """Finds where messages of one topic are missing, batch by batch."""

    def __init__(self) -> None:
        self._step = self._period_s = 0.0
        self._last: tuple[float, float] | None = None

    def insert(
        self, t_s: Array, places: Array, columns: Mapping[str, Array], health: str = ""
    ) -> tuple[Array, dict[str, Array]]:
        """Times and columns with a row behind the last message before each gap: NaN, or UNKNOWN in column `health`.

        t_s, shape (N,), in s; `places`, shape (N,): ticks, or times where there are none, whose usual step is that of
        the first batch. The row has the time at which the next message was due.
        """
        joined = places.astype(np.float64)
        times = t_s
        if self._last is not None:
            joined, times = np.r_[self._last[0], joined], np.r_[self._last[1], t_s]
        if len(joined) < 2:
            self._last = (float(joined[-1]), float(times[-1])) if len(joined) else None
            return t_s, dict(columns)
        steps = np.diff(joined)
        if not self._step:
            self._step, self._period_s = float(np.median(steps)), float(np.median(np.diff(times)))
        late = np.flatnonzero(steps > _LATE * self._step) if self._step > 0 else np.empty(0, dtype=np.int64)
        self._last = float(joined[-1]), float(times[-1])
        before = late + 1 - (len(joined) - len(places))
        if not len(late):
            return t_s, dict(columns)
        return np.insert(t_s, before, times[late] + self._period_s), {
            name: _unknown_before(values, before, name == health) for name, values in columns.items()
        }


def _unknown_before(values: Array, rows: Array, health: bool) -> Array:
    if health:
        return np.insert(values.astype(np.int64), rows, UNKNOWN)
    return np.insert(values.astype(np.float64), rows, np.nan, axis=0)


def newest(t_s: Array, values: Array, at_s: Array) -> Array:
    """The last of the values (N,) at t_s up to each time of at_s; NaN before the first. Nothing is interpolated."""
    places = np.searchsorted(t_s, at_s, side="right") - 1
    if not len(values):
        return np.full(len(at_s), np.nan)
    return np.where(places < 0, np.nan, values[np.maximum(places, 0)])


def thinned(t_s: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Reduces to about `points` samples and keeps extremes: minimum and maximum of each time interval.

    Intervals with a NaN are kept whole, so that every gap stays where it is.
    """
    step = 2 * len(t_s) // points
    if step <= 2:
        return t_s, values
    n = len(t_s) // step * step
    stretches = values[:n].reshape(-1, step)
    kept = np.ones(len(t_s), dtype=bool)
    whole = ~np.isnan(stretches).any(axis=1)
    begins = np.arange(0, n, step)[whole]
    kept[:n].reshape(-1, step)[whole] = False
    for extreme in (np.argmin, np.argmax):
        kept[begins + extreme(stretches[whole], axis=1)] = True
    return t_s[kept], values[kept]
