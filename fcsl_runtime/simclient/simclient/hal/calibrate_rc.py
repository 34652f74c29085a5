# SPDX-License-Identifier: Apache-2.0
"""Ranges of the channels of a remote control."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..vars.show import table
from .board_edit import Changes
from .board_file import Target
from .collect import Report, Source
from .errors import Refused
from .fit_rc import Range, fit_ranges
from .least_squares import Vector

SECONDS = 20.0
_REST_S = 3.0
_SAMPLES_MIN = 10


def calibrate_rc(target: Target, seconds: float) -> Changes:
    """What changes in the backend. Raises Refused."""
    with Source(target, "sticks", optional=("failsafe",)) as source:
        print(f"release all sticks for {_REST_S:g} s", flush=True)
        rest = _collect(source, target, _REST_S)
        print(f"move all sticks and switches to all their ends, for {seconds:g} s", flush=True)
        moved = _collect(source, target, seconds)
    count = min(_channel_count(rest), _channel_count(moved))
    ranges = fit_ranges(rest[:, :count], moved[:, :count])
    if not any(ranges):
        raise Refused("no channel was moved")
    print(table([("channel", "minimum", "middle", "maximum", "deadband"), *_rows(ranges)]))
    sticks = [_stick(target, channel, found) for channel, found in enumerate(ranges)]
    while not sticks[-1]:
        sticks.pop()
    return {"sticks": sticks}


def _collect(source: Source, target: Target, seconds: float) -> Vector:
    """Samples × channels. Raises Refused where the receiver has no transmitter."""
    taken, report = [], Report()
    for at, values in source.samples(seconds):
        if any(values.get(target.signal("failsafe"), [])):
            raise Refused("failsafe: the receiver has lost the transmitter")
        taken.append(values[target.signal("sticks")])
        if report.is_due(at):
            array = np.array(taken)[:, : _channel_count(np.array(taken))]
            ranges = zip(array.min(axis=0), array.max(axis=0), strict=True)
            report.at(at, f"{at:.0f} s: " + "  ".join(f"{low:.0f}-{high:.0f}" for low, high in ranges))
    report.end()
    if len(taken) < _SAMPLES_MIN:
        raise Refused(f"only {len(taken)} samples came in {seconds:g} s: is the transmitter on?")
    return np.array(taken)


def _channel_count(samples: Vector) -> int:
    """How many channels, from the first one on, every sample has."""
    missing = np.isnan(samples).any(axis=0)
    return int(missing.argmax()) if missing.any() else samples.shape[1]


def _rows(ranges: list[Range | None]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for channel, found in enumerate(ranges):
        if found is None:
            rows.append((str(channel), "not moved", "", "", ""))
        else:
            numbers = (found.minimum, found.middle, found.maximum, found.deadband)
            rows.append((str(channel), *(f"{number:g}" for number in numbers)))
    return rows


def _stick(target: Target, channel: int, found: Range | None) -> dict[str, Any]:
    """One that was not moved keeps what it has; a reversed one stays reversed."""
    before = target.backend.sticks[channel] if channel < len(target.backend.sticks) else None
    if found is None:
        return {} if before is None else _members(before.minimum, before.middle, before.maximum, before.deadband)
    if before is not None and before.maximum < before.minimum:
        return _members(found.maximum, found.middle, found.minimum, found.deadband)
    return _members(found.minimum, found.middle, found.maximum, found.deadband)


def _members(minimum: float, middle: float, maximum: float, deadband: float) -> dict[str, Any]:
    numbers = {"minimum": minimum, "middle": middle, "maximum": maximum, "deadband": deadband}
    return {key: int(number) if number == int(number) else number for key, number in numbers.items()}
