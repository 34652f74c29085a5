# SPDX-License-Identifier: Apache-2.0
"""Offset and scale of an accelerometer, from six positions: each end of each axis of the device up once, in any order."""

from __future__ import annotations

from collections import deque

import numpy as np

from .board_edit import Changes
from .board_file import Target
from .collect import Report, Source
from .describe import show_numbers
from .errors import Refused
from .fit_accel import GRAVITY, AccelFit, fit_accel, side_up
from .fit_still import fit_still
from .least_squares import Vector
from .rounding import rounded

SECONDS = 300.0
#: For how long the device is at rest, and the standard deviation of an axis then, in m/s^2.
_STILL_S, _DEVIATION_MAX = 1.0, 0.2
_POLL_S = 0.1
_SAMPLES_MIN = 5
_SIDES = [(axis, sign) for axis in range(3) for sign in (1, -1)]
#: Beyond those of any accelerometer that works; the offset in m/s^2.
_OFFSET_MAX, _SCALE_MIN, _SCALE_MAX = 3.0, 0.8, 1.25

Side = tuple[int, int]


def calibrate_accel(target: Target, seconds: float) -> Changes:
    """What changes in the backend. Raises Refused."""
    with Source(target, "accel") as source:
        sides = _collect(source, seconds)
    fit = fit_accel(np.array(list(sides.values())))
    _check(fit)
    print(f"offset {show_numbers(fit.offset)} m/s^2, scale {show_numbers(fit.scale)}")
    print(f"residuals of |corrected| - {GRAVITY:g}: {show_numbers(fit.residuals, 2)} m/s^2")
    return {"correct": {"accel": {"offset": rounded(fit.offset), "scale": rounded(fit.scale)}}}


def _name(side: Side) -> str:
    return f"{'+' if side[1] > 0 else '-'}{'xyz'[side[0]]}"


def _collect(source: Source, seconds: float) -> dict[Side, Vector]:
    """The mean of each side. Raises Refused when the time is over."""
    sides: dict[Side, Vector] = {}
    window: deque[tuple[float, Vector]] = deque()
    report, next_s = Report(), _STILL_S
    print(f"put each side of the vehicle up once, in any order, and keep it still; {seconds:g} s for all", flush=True)
    for at, vector in source.vectors(seconds):
        window.append((at, vector))
        while at - window[0][0] > _STILL_S:
            window.popleft()
        if at < next_s:
            continue
        next_s = at + _POLL_S
        still = fit_still(np.array([v for _, v in window])) if len(window) >= _SAMPLES_MIN else None
        if still is None or (still.deviation > _DEVIATION_MAX).any():
            report.at(at, "it moves")
            continue
        side = side_up(still.mean)
        if side is None or side in sides:
            report.at(at, f"{f'{_name(side)} is up, and done' if side else 'no side is up'}; left: {_left(sides)}")
            continue
        sides[side] = still.mean
        report.end()
        print(
            f"{_name(side)} is up: {show_numbers(still.mean)} m/s^2. {len(sides)} of 6; left: {_left(sides)}",
            flush=True,
        )
        if len(sides) == len(_SIDES):
            return sides
    report.end()
    raise Refused(f"after {seconds:g} s these sides have not been up and still: {_left(sides)}")


def _left(sides: dict[Side, Vector]) -> str:
    return ", ".join(_name(side) for side in _SIDES if side not in sides) or "none"


def _check(fit: AccelFit) -> None:
    axis = int(np.abs(fit.offset).argmax())
    if abs(fit.offset[axis]) > _OFFSET_MAX:
        raise Refused(
            f"the offset of {'xyz'[axis]} is {fit.offset[axis]:.3g} m/s^2: no accelerometer is off by {_OFFSET_MAX:g}"
        )
    if not ((fit.scale > _SCALE_MIN) & (fit.scale < _SCALE_MAX)).all():
        scale = show_numbers(fit.scale)
        raise Refused(
            f"the scale {scale} is not between {_SCALE_MIN:g} and {_SCALE_MAX:g}: is the unit of the device m/s^2?"
        )
