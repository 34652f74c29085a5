# SPDX-License-Identifier: Apache-2.0
"""Curves in a terminal: a panel of braille dots with a scale for each path (fcsl var plot)."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence

#: Dots of a braille character: two columns of four rows, each with its bit.
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BLANK = 0x2800
_LABEL_WIDTH = 11
_MIN_HEIGHT = 3


class Canvas:
    """`width` × `height` characters; dots are numbered from the lower left."""

    def __init__(self, width: int, height: int):
        self.width, self.height = width, height
        self._cells = [[0] * width for _ in range(height)]

    def dot(self, x: int, y: int) -> None:
        """Sets a dot; dots outside of the canvas are ignored."""
        if 0 <= x < 2 * self.width and 0 <= y < 4 * self.height:
            row = 4 * self.height - 1 - y
            self._cells[row // 4][x // 2] |= _BITS[row % 4][x % 2]

    def line(self, x: int, y: int, to_x: int, to_y: int) -> None:
        steps = max(abs(to_x - x), abs(to_y - y), 1)
        for i in range(steps + 1):
            self.dot(x + round(i * (to_x - x) / steps), y + round(i * (to_y - y) / steps))

    def rows(self) -> list[str]:
        return ["".join(chr(_BLANK + cell) for cell in row) for row in self._cells]


def _limits(curves: Sequence[Sequence[float]]) -> tuple[float, float]:
    finite = [value for curve in curves for value in curve if math.isfinite(value)]
    low, high = (min(finite), max(finite)) if finite else (0.0, 1.0)
    if low / 2 == high / 2:  # the scale is computed with halved limits
        margin = abs(low) * 0.1 or 1.0
        return max(low - margin, -sys.float_info.max), min(high + margin, sys.float_info.max)
    return low, high


def draw_panel(
    title: str, ticks: Sequence[int], curves: Sequence[Sequence[float]], width: int, height: int
) -> list[str]:
    """A title, `height` rows with a scale, and an axis of ticks; every line has at most `width` characters, or 23.

    A curve has a value for each of `ticks`; NaN and infinities leave a gap.
    """
    canvas = Canvas(max(10, width - _LABEL_WIDTH - 2), max(_MIN_HEIGHT, height))
    low, high = _limits(curves)
    span = max(1, ticks[-1] - ticks[0])
    top = 4 * canvas.height - 1

    def place(tick: int, value: float) -> tuple[int, int]:
        x = (tick - ticks[0]) / span * (2 * canvas.width - 1)
        # Halve first: the difference of two large numbers may overflow.
        y = (value / 2 - low / 2) / (high / 2 - low / 2) * top
        return round(x), round(y)

    for curve in curves:
        before: tuple[int, int] | None = None
        for tick, value in zip(ticks, curve, strict=True):
            here = place(tick, value) if math.isfinite(value) else None
            if here is not None:
                canvas.line(*(before or here), *here)
            before = here
    rows = canvas.rows()
    labels = {0: high, len(rows) - 1: low, len(rows) // 2: low / 2 + high / 2}
    lines = [title[:width]]
    for i, row in enumerate(rows):
        lines.append(f"{labels[i]:{_LABEL_WIDTH}.4g} ┤{row}" if i in labels else f"{'':{_LABEL_WIDTH}} │{row}")
    first, last = f"{ticks[0]}", f"tick {ticks[-1]}"
    lines.append(f"{'':{_LABEL_WIDTH}} └{'─' * canvas.width}")
    lines.append(f"{'':{_LABEL_WIDTH}}  {first}{last:>{max(1, canvas.width - len(first))}}")
    return lines
