# SPDX-License-Identifier: Apache-2.0
"""Curves of `fcsl hal monitor --plot`: the corrected values of sensors, of the last 10 s."""

from __future__ import annotations

import math
from collections import deque

from ..vars.show import with_unit
from ..vars.terminal_plot import draw_panel
from .describe import show_numbers
from .watch import Watch, quantity_ranges

_WINDOW_S, _POINTS = 10, 500
_TITLE_ROWS = 3  # of a panel: its title, its axis, its ticks


class Curves:
    """Takes every n-th tick, so that the window has at most 500 points."""

    def __init__(self, watch: Watch, sensors: list[int]):
        self._watch, self._sensors = watch, sensors
        self._every = max(1, watch.plan.tick_hz * _WINDOW_S // _POINTS)
        points = min(_POINTS, watch.plan.tick_hz * _WINDOW_S)
        self._ticks: deque[int] = deque(maxlen=points)
        self._rows: dict[tuple[int, str], deque[list[float]]] = {
            (s, p.name): deque(maxlen=points) for s in sensors for p in quantity_ranges(watch.plan.sensors[s].kind)
        }

    def take(self, tick: int) -> None:
        if tick % self._every:
            return
        self._ticks.append(tick)
        for s in self._sensors:
            values = self._watch.corrected(s) or {}
            for quantity in quantity_ranges(self._watch.plan.sensors[s].kind):
                self._rows[s, quantity.name].append(values.get(quantity.name, []))

    def lines(self, width: int, height: int) -> list[str]:
        shown = {key: rows for key, rows in self._rows.items() if any(rows)}
        if not shown:
            return ["no sensor has a healthy device yet"]
        each = height // len(shown) - _TITLE_ROWS
        lines = []
        for (s, name), rows in shown.items():
            sensor = self._watch.plan.sensors[s]
            unit = next(p.unit for p in quantity_ranges(sensor.kind) if p.name == name)
            title = f"{sensor.name}.{name} = {with_unit(show_numbers(rows[-1], unit=unit), unit)}"
            count = max(map(len, rows))
            curves = [[row[i] if i < len(row) else math.nan for row in rows] for i in range(count)]
            lines += draw_panel(title, list(self._ticks), curves, width, each)
        return lines
