# SPDX-License-Identifier: Apache-2.0
"""ValueFeed: what telemetry brought of chosen values since the last question, thinned for a picture."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ..c_machine import HEALTH_NAMES
from ..descriptor import Machine
from ..errors import TwinError
from ..paths import Selection
from ..telemetry.window import Window
from ..view.rotation import ANGLES, euler_deg
from .http_error import HttpError
from .limits import STREAM_FIRST_POINTS, STREAM_POINTS, STREAM_VALUES
from .runs import Run
from .thinning import Array, thin
from .windows import fields_below, unknown_path

_STATE = "machine.state"
_STALE = HEALTH_NAMES.index("stale")
_QUATERNION = (4,)
#: Roles of the fields that an instance leaves as they were while it is stale; its health says so itself.
_EXECUTE_SETS = ("input", "output", "state")


class ValueFeed:
    """Updates of one run for one reader. Not thread-safe."""

    def __init__(self, run: Run, paths: Sequence[str], angles: Sequence[str]):
        """`paths`: values, or groups of them; `angles`: quaternions, scalar first, of which roll, pitch and yaw are sent."""
        self._run, self._paths, self._angles = run, paths, angles
        self._chosen: list[Selection] = []
        self._turned: list[Selection] = []
        self._last: Window | None = None
        self._state = -1

    def check(self) -> None:
        """Raises HttpError if telemetry does not send a path, as far as its configuration is known."""
        with suppress(TwinError):
            self._choose(self._run.telemetry.machine)

    def update(self) -> bytes | None:
        """The JSON of the ticks since the last update; first those that are kept. None if there are none.

        Raises HttpError if telemetry does not send a path.
        """
        telemetry = self._run.telemetry
        try:
            machine = telemetry.machine
        except TwinError:  # nothing was received yet, or an ended run's window was given up
            return None
        last = self._last
        if last is None or last.session != telemetry.session:
            self._choose(machine)
        try:
            window = telemetry.window(self._fields(machine), after=last)
        except TwinError as error:  # another session began meanwhile
            raise unknown_path(error, self._paths) from None
        if not len(window):
            return None
        began = last is None or last.session != window.session
        self._last = window
        if began:
            self._state = -1
        return json.dumps(self._as_json(window, None if began else last), separators=(",", ":")).encode()

    # ---- which values -----------------------------------------------------------------------------------------------

    def _choose(self, machine: Machine) -> None:
        try:
            self._chosen = [leaf for path in self._paths for leaf in fields_below(path, machine).values()]
            self._turned = [leaf for path in self._angles for leaf in fields_below(path, machine).values()]
        except TwinError as error:
            raise unknown_path(error, [*self._paths, *self._angles]) from None
        for leaf in self._turned:
            if leaf.shape != _QUATERNION:
                raise HttpError(400, "bad_value", f"angles: {leaf.path[:80]!r} is no array of 4, a quaternion")
        values = sum(math.prod(leaf.shape) for leaf in self._chosen) + len(ANGLES) * len(self._turned)
        if values > STREAM_VALUES:
            raise HttpError(413, "too_large", f"a stream has at most {STREAM_VALUES} values, not {values}")

    def _fields(self, machine: Machine) -> list[str]:
        """The fields to read: those of the values, the healths of their instances, and the state."""
        leaves = [*self._chosen, *self._turned]
        wanted = {leaf.field.path for leaf in leaves} | {_health(leaf) for leaf in leaves} | {_STATE}
        return [path for path in wanted if path in machine.fields] or [next(iter(machine.fields))]

    # ---- an update --------------------------------------------------------------------------------------------------

    def _as_json(self, window: Window, last: Window | None) -> dict[str, Any]:
        tick, time_s = window.tick, window.time_s
        before = tick[:1] - window.configuration.every if last is None else last.tick[-1:]
        gaps = np.abs(np.diff(tick, prepend=before) - window.configuration.every)
        thinned = thin(gaps, STREAM_FIRST_POINTS if last is None else STREAM_POINTS)
        return {
            "run": self._run.name,
            "session": str(window.session),
            "tick": int(tick[-1]),
            "first": last is None,
            "time_s": _numbers(time_s[thinned.rows]),
            "breaks": thinned.breaks.tolist(),
            "values": {name: _numbers(thinned.of(column)) for name, column in self._columns(window)},
            "states": self._states(window),
        }

    def _columns(self, window: Window) -> Iterator[tuple[str, Array]]:
        """Name and values of each curve, NaN where its instance is stale."""
        for leaf in self._chosen:
            for index, column in zip(np.ndindex(*leaf.shape), _values(window, leaf).T, strict=True):
                yield leaf.path + "".join(f"[{i}]" for i in index), column
        for leaf in self._turned:
            for angle, column in zip(ANGLES, euler_deg(_values(window, leaf)).T, strict=True):
                yield f"{leaf.path}.{angle}", column

    def _states(self, window: Window) -> list[tuple[float, str]]:
        """Times, and the state that began then; of very many, some."""
        field = window.machine.fields.get(_STATE)
        if field is None or field.type != "state":
            return []
        numbers = window.numbers(_STATE)[:, 0].astype(int)
        rows = np.flatnonzero(np.diff(numbers, prepend=self._state))
        self._state = int(numbers[-1])
        if len(rows) > STREAM_POINTS:
            rows = rows[np.linspace(0, len(rows) - 1, STREAM_POINTS).astype(int)]
        names = window.machine.states
        found = (
            (time_s, int(numbers[row])) for time_s, row in zip(window.time_s[rows].round(9).tolist(), rows, strict=True)
        )
        return [(time_s, names[number] if number < len(names) else "") for time_s, number in found]


def _health(leaf: Selection) -> str:
    return f"{leaf.field.instance}.outputs.health"


def _values(window: Window, leaf: Selection) -> Array:
    """float64 of shape (rows, scalars), NaN where the instance was stale: then its values are old."""
    numbers = window.numbers(leaf.field.path)[:, leaf.element : leaf.element + leaf.count].astype(np.float64)
    sets = leaf.field.role in _EXECUTE_SETS and leaf.field.type != "Health"
    if sets and _health(leaf) in window.machine.fields:
        numbers[window.numbers(_health(leaf))[:, 0] == _STALE] = np.nan
    return numbers


def _numbers(values: Array) -> list[float | None]:
    """With 9 digits, enough for a picture; null for NaN and infinities."""
    return [float(f"{value:.9g}") if math.isfinite(value) else None for value in values.tolist()]
