# SPDX-License-Identifier: Apache-2.0
"""Live output of fcsl var: `watch` prints a table or lines, `plot` draws curves."""

from __future__ import annotations

import json
import sys
import time
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from ..screen import Screen
from .answers import units_of
from .client import VarClient
from .show import flat, jsonable, show_value, with_unit
from .subscription import Sample, Subscription
from .terminal_plot import draw_panel
from .wire import VarError

#: Shortest time between two redraws, in s.
_PERIOD_S = 0.05
_TITLE_ROWS = 3  # of a panel: its title, its axis, its ticks
_CURVES_MAX = 64


class Display(Protocol):
    """Takes samples and formats them as lines."""

    def take(self, sample: Sample) -> None: ...

    def lines(self, width: int, height: int) -> list[str]: ...


def watch(client: VarClient, paths: Sequence[str], every: int, ticks: int | None, as_json: bool) -> None:
    """Shows values of `ticks` ticks (None: until Ctrl-C), in place on a terminal, else a line per sample."""
    paths = [path for path, _ in _fields(client, paths)]
    units = units_of(client, paths)
    with client.subscribe(*paths, every=every) as subscription:
        _report_paused(client)
        samples = _until(subscription, every, ticks)
        if sys.stdout.isatty() and not as_json:
            _show_live(_Table(units), subscription, samples)
            return
        for sample in samples:
            if as_json:
                entry = {"tick": sample.tick, "lost": sample.lost, "values": jsonable(sample.values)}
                print(json.dumps(entry), flush=True)
            else:
                shown = "  ".join(f"{p} = {with_unit(show_value(v), units[p])}" for p, v in sample.values.items())
                print(f"{sample.tick}  {shown}", flush=True)


def plot(client: VarClient, paths: Sequence[str], every: int, ticks: int | None, window: int) -> None:
    """Draws numbers over ticks: live on a terminal, elsewhere once, after `ticks` ticks."""
    if ticks is None and not sys.stdout.isatty():
        raise VarError("bad_request", "without a terminal plot draws once: give the number of ticks with --ticks")
    now = {path: value for path, value in _fields(client, paths) if path in paths or _is_number(value)}
    curves = _Curves(units_of(client, list(now)), now, window)
    with client.subscribe(*now, every=every) as subscription:
        _report_paused(client)
        samples = _until(subscription, every, ticks)
        if sys.stdout.isatty():
            _show_live(curves, subscription, samples)
            return
        for sample in samples:
            curves.take(sample)
        print("\n".join(curves.lines(*Screen.size())))


def _fields(client: VarClient, paths: Sequence[str]) -> list[tuple[str, Any]]:
    """Every field that the paths name, and its value."""
    return [row for path, value in client.get(*paths).items() for row in flat(path, value)]


def _report_paused(client: VarClient) -> None:
    state = client.state()
    if state["paused"]:
        print(f"fcsl var: paused at tick {state['tick']}: values appear when it resumes", file=sys.stderr)


def _until(subscription: Subscription, every: int, ticks: int | None) -> Iterator[Sample]:
    """Yields the first sample, and then samples up to the last one due within `ticks` ticks."""
    for count, sample in enumerate(subscription, start=1):
        yield sample
        if ticks is not None and (count + sample.lost + 1) * every > ticks:
            return


def _show_live(display: Display, subscription: Subscription, samples: Iterator[Sample]) -> None:
    """Redraws with all samples received since the last drawing; leaves the last drawing on the screen."""
    due = 0.0
    with Screen() as screen:
        for sample in samples:
            display.take(sample)
            if subscription.waiting() == 0 and time.monotonic() >= due:
                screen.draw(display.lines(*screen.size()))
                due = time.monotonic() + _PERIOD_S
        screen.draw(display.lines(*screen.size()))


class _Table:
    """The newest sample."""

    def __init__(self, units: dict[str, str]):
        self._units = units
        self._sample = Sample(0, 0, 0, {})

    def take(self, sample: Sample) -> None:
        self._sample = sample

    def lines(self, width: int, height: int) -> list[str]:
        lost = f"   ({self._sample.lost} samples lost)" if self._sample.lost else ""
        column = max((len(path) for path in self._sample.values), default=0)
        rows = [f"{p:{column}}  {with_unit(show_value(v), self._units[p])}" for p, v in self._sample.values.items()]
        return [f"tick {self._sample.tick}{lost}", *rows]


class _Curves:
    """The newest `window` samples."""

    def __init__(self, units: dict[str, str], now: dict[str, Any], window: int):
        self._units = units
        self._now = now
        self._ticks: deque[int] = deque(maxlen=window)
        self._curves = {path: [deque[float](maxlen=window) for _ in _numbers(path, v)] for path, v in now.items()}

    def take(self, sample: Sample) -> None:
        self._now = sample.values
        self._ticks.append(sample.tick)
        for path, value in sample.values.items():
            for curve, number in zip(self._curves[path], _numbers(path, value), strict=True):
                curve.append(number)

    def lines(self, width: int, height: int) -> list[str]:
        if not self._ticks:
            return []
        each = height // len(self._curves) - _TITLE_ROWS
        lines = []
        for path, curves in self._curves.items():
            title = f"{path} = {with_unit(show_value(self._now[path]), self._units[path])}"
            lines += draw_panel(title, list(self._ticks), [list(curve) for curve in curves], width, each)
        return lines


def _is_number(value: Any) -> bool:
    return _is_number(value[0]) if isinstance(value, list) else isinstance(value, (bool, int, float))


def _numbers(path: str, value: Any) -> list[float]:
    """A curve for each scalar. Raises VarError for a value that is not a number."""
    if isinstance(value, list):
        numbers = [number for item in value for number in _numbers(path, item)]
        if len(numbers) > _CURVES_MAX:
            raise VarError("bad_value", f"{path}: {len(numbers)} curves are too many for one picture; choose a part")
        return numbers
    if isinstance(value, (bool, int, float)):
        return [float(value)]
    raise VarError("bad_value", f"{path}: {value!r} is not a number; use watch")
