# SPDX-License-Identifier: Apache-2.0
"""The picture of a frequency response: Bode diagrams of loop, sensitivity and outputs, a column each.

Gain and phase crossovers have a dot, and the distance to instability there is a bar with its number. Where nothing was
measured, the diagrams are shaded, and a line below them says why.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from simclient.errors import BagError
from simclient.view.picture import pyplot, save

from ..errors import SimError
from .response import Point, crossings, measured_runs
from .response_report import Measured, decibels, gain_text, peak_text, phase_text

_BLUE, _RED, _GREY, _SHADE = "#2a78b5", "#c8442c", "#888888", "#e4e4e4"
_COLUMN_IN, _HEIGHT_IN = 5.2, 6.0
#: Of the reasons why nothing was measured.
_LINES, _LETTERS_PER_COLUMN = 8, 90
_NO_LOOP = "no loop: the source does not depend on the sine"
_NOT_MEASURED = "not measured: reasons below"


@dataclass
class _Column:
    """A Bode diagram. `lines`: label, value (0: none) and colour of each; `gaps`: points without any, with the reason."""

    title: str
    lines: Sequence[tuple[str, Callable[[Point], complex], str]]
    second_title: str = ""
    gaps: dict[float, str] = field(default_factory=dict)


def draw(measured: Measured, path: Path, title: str) -> None:
    """Writes the picture, whole or not at all. Raises SimError."""
    figure = bode_figure(measured, title)
    try:
        save(figure, path)
    except BagError as error:
        raise SimError(str(error)) from None
    finally:
        pyplot.close(figure)


def bode_figure(measured: Measured, title: str) -> Any:
    """The matplotlib figure."""
    columns = _columns(measured)
    width = max(2, len(columns))
    figure, axes = pyplot.subplots(
        2, len(columns), sharex=True, squeeze=False, figsize=(_COLUMN_IN * width, _HEIGHT_IN), layout="constrained"
    )
    for column, (gain, phase) in zip(columns, axes.T, strict=True):
        _draw_column(column, gain, phase, measured.requested)
    found = measured.margins
    if found:
        _mark_loop(axes[:, 0], measured.requested)
        axes[0, 1].plot(found.peak_frequency, decibels(found.peak_sensitivity), "o", color=_RED, zorder=4)
    figure.suptitle(f"{title}, sine at {', '.join(path for path, _ in measured.inputs)}", fontsize=10)
    reasons = {omega: why for column in columns for omega, why in column.gaps.items()}
    if reasons:
        figure.supxlabel(_reasons_text(reasons, _LETTERS_PER_COLUMN * width), x=0.01, ha="left", fontsize=8)
    return figure


def _columns(measured: Measured) -> list[_Column]:
    unsettled = {point.omega: point.why for point in measured.requested if not point.is_settled}
    columns = []
    if measured.margins:
        gaps = unsettled | {point.omega: _NO_LOOP for point in measured.points if not point.has_loop}
        found = measured.margins
        loop = [("loop", lambda point: point.loop if point.has_loop else 0j, _BLUE)]
        columns.append(_Column(f"loop: {gain_text(found)}", loop, phase_text(found), gaps))
        sensitivity = [("sensitivity", lambda point: point.sensitivity if point.has_loop else 0j, _RED)]
        columns.append(_Column(peak_text(found), sensitivity, gaps=gaps))
    if measured.outputs or not columns:
        lines = [
            (f"{name} ({unit})" if unit else name, partial(Point.response, output=i), f"C{i}")
            for i, (name, unit) in enumerate(measured.outputs)
        ]
        columns.append(_Column("outputs" if measured.margins else f"outputs; {_NO_LOOP}", lines, gaps=unsettled))
    return columns


def _draw_column(column: _Column, gain: Any, phase: Any, points: Sequence[Point]) -> None:
    for low, high in _spans([point.omega for point in points], column.gaps):
        for axis in (gain, phase):
            axis.axvspan(low, high, color=_SHADE, linewidth=0, zorder=0, label=_NOT_MEASURED if axis is gain else None)
    for label, value, colour in column.lines:
        for omega, values, phases in _runs(points, value):
            gain.semilogx(omega, [decibels(v) for v in values], ".-", color=colour, label=label)
            phase.semilogx(omega, phases, ".-", color=colour)
            label = "_nolegend_"
    for axis, name, title in ((gain, "gain (dB)", column.title), (phase, "phase (°)", column.second_title)):
        axis.set_xscale("log")
        axis.set_ylabel(name)
        axis.set_title(title, fontsize=9, loc="left")
        axis.grid(True, which="both", color="#dddddd", linewidth=0.5)
    phase.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    phase.xaxis.set_major_formatter("{x:g}")
    phase.xaxis.set_minor_formatter(NullFormatter())
    phase.set_xlabel("rad/s")
    handles = dict(zip(*gain.get_legend_handles_labels()[::-1], strict=True))  # each label once
    if handles:
        gain.legend(handles.values(), handles.keys(), fontsize=8)


def _runs(
    points: Sequence[Point], value: Callable[[Point], complex]
) -> list[tuple[list[float], list[complex], np.ndarray[Any, Any]]]:
    """Frequencies, values and phases (degrees) of a line for each run of frequencies with a value: none leads across one
    without. A line begins within -270 and 90 degrees."""
    runs = []
    for run in measured_runs(points, lambda point: point.is_settled and value(point) != 0):
        values = [value(point) for point in run]
        phases = np.degrees(np.unwrap(np.angle(values)))
        runs.append(([point.omega for point in run], values, phases - 360.0 * round((phases[0] + 90.0) / 360.0)))
    return runs


def _mark_loop(axes: Any, points: Sequence[Point]) -> None:
    """The lines of 0 dB and of -180 degrees, each crossing with a dot in the one axis, and its margin in the other."""
    gain, phase = axes
    gain.axhline(0.0, color=_GREY, linewidth=0.8)
    at_gain, at_phase = crossings(points)
    runs = _runs(points, lambda point: point.loop if point.has_loop else 0j)
    for omega, margin in at_gain:
        angle = _at(omega, [(run, phases) for run, _, phases in runs])
        level = 360.0 * round((angle + 180.0) / 360.0) - 180.0
        _mark(omega, (gain, 0.0), (phase, angle, level), f"{math.degrees(margin):.1f}°")
    for omega, factor in at_phase:
        size = _at(omega, [(run, np.array([decibels(v) for v in values])) for run, values, _ in runs])
        angle = _at(omega, [(run, phases) for run, _, phases in runs])
        _mark(omega, (phase, angle), (gain, size, 0.0), f"{decibels(factor):.1f} dB")
    lowest, highest = phase.get_ylim()
    for turn in range(math.floor(lowest / 360.0), math.ceil(highest / 360.0) + 1):
        if lowest <= 360.0 * turn - 180.0 <= highest:
            phase.axhline(360.0 * turn - 180.0, color=_GREY, linewidth=0.8)


def _mark(omega: float, crossing: tuple[Any, float], margin: tuple[Any, float, float], text: str) -> None:
    axis, value = crossing
    axis.plot(omega, value, "o", color=_RED, zorder=4)
    other, end, level = margin
    for each in (axis, other):
        each.axvline(omega, color=_RED, linewidth=0.8, linestyle=":")
    other.plot([omega, omega], [end, level], "-", color=_RED, linewidth=2.5, zorder=3)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.8}
    other.annotate(
        text,
        (omega, (end + 2 * level) / 3),
        (5, 0),
        textcoords="offset points",
        color=_RED,
        fontsize=8,
        va="center",
        bbox=box,
    )


def _at(omega: float, runs: Sequence[tuple[list[float], np.ndarray[Any, Any]]]) -> float:
    """The value at a frequency within one of the runs; between points, linear in the logarithm of the frequency."""
    omegas, values = next((o, v) for o, v in runs if o[0] * (1 - 1e-9) <= omega <= o[-1] * (1 + 1e-9))
    return float(np.interp(math.log(omega), np.log(omegas), values))


def _spans(omegas: Sequence[float], gaps: dict[float, str]) -> list[tuple[float, float]]:
    """From the middle before each of `gaps` to the middle behind it; neighbours are joined."""
    if len(omegas) < 2:
        return []
    logs = np.log(omegas)
    middles = np.concatenate([[logs[0] - (logs[1] - logs[0]) / 2], (logs[1:] + logs[:-1]) / 2])
    middles = np.append(middles, logs[-1] + (logs[-1] - logs[-2]) / 2)
    found: list[tuple[float, float]] = []
    for i, omega in enumerate(omegas):
        if omega not in gaps:
            continue
        low, high = math.exp(middles[i]), math.exp(middles[i + 1])
        if found and found[-1][1] == low:
            low = found.pop()[0]
        found.append((low, high))
    return found


def _reasons_text(reasons: dict[float, str], letters: int) -> str:
    lines = [
        line
        for omega, why in sorted(reasons.items())
        for line in textwrap.wrap(f"{omega:.4g} rad/s not measured: {why}", letters)
    ]
    more = [f"… and {len(lines) - _LINES} more lines: `fcsl response` prints all"] if len(lines) > _LINES else []
    return "\n".join([*lines[:_LINES], *more])
