# SPDX-License-Identifier: Apache-2.0
"""One picture of a run: the output of `python -m simclient.plot`.

It shows altitude, velocity and throttle if the vehicle has them, and roll, pitch and yaw if it has attitudes; otherwise
every output. Background colours are the states of the machine; values of stale instances are left out.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from ..bag import Array, Bag
from ..cli import complete_or_absent
from ..errors import BagError
from .signals import ALTITUDE, STATUS_FIELDS, THROTTLE, VELOCITY
from .summary import ANGLES, RunSummary, Source, euler_deg, read_summary, thinned

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  the backend must be chosen first

SUFFIXES = (".png", ".svg", ".pdf")
MAX_PANELS = 8
_POINTS = 4000
_DPI = 120
_TRUTH_COLOUR = "black"
#: Line colours (Okabe-Ito, distinguishable with colour blindness) and paler ones for states.
LINE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F7F7F")
STATE_COLOURS = ("#DCEBF7", "#E3F3DC", "#FCEBD2", "#F8D9DC", "#E8E0F2", "#F4F1C9", "#E3E3E3")


@dataclass(frozen=True, eq=False)
class Line:
    label: str
    t_s: Array
    values: Array
    truth: bool = False
    raw: bool = False


@dataclass(frozen=True)
class Panel:
    """One set of axes; `title` is its y label."""

    title: str
    lines: tuple[Line, ...]


def _line(source: Source, field: str, raw: bool) -> Line:
    label = f"{source.name} (truth)" if source.truth else f"{source.name}.{field}"
    return Line(label, source.t_s, source.running(field), source.truth, raw)


def _vehicle_panels(summary: RunSummary) -> list[Panel]:
    """Altitude, velocity, throttle."""
    panels = []
    for title, names in (("altitude, m", ALTITUDE), ("velocity, m/s", VELOCITY), ("throttle", THROTTLE)):
        found = summary.named(names)
        lines = tuple(_line(source, field, source.name == summary.raw) for source, field in found)
        if lines:
            panels.append(Panel(title, lines))
    return panels


def _attitude_panels(summary: RunSummary) -> list[Panel]:
    found = [
        (source, euler_deg(np.stack([source.fields[name][:, i] for i in range(4)], axis=1)), name)
        for source, name in summary.quaternions()
    ]
    if not found:
        return []
    return [
        Panel(f"{title}, deg", tuple(Line(f"{s.name}.{name}", s.t_s, unjoined(a[:, i])) for s, a, name in found))
        for i, title in enumerate(ANGLES)
    ]


def unjoined(angles_deg: Array) -> Array:
    """The angles with a gap where they wrap, so that no line is drawn across."""
    angles = angles_deg.copy()
    angles[1:][np.abs(np.diff(angles_deg)) > 180.0] = np.nan
    return angles


def _other_panels(summary: RunSummary) -> list[Panel]:
    """One panel per output name, arrays by element; the first MAX_PANELS."""
    panels: dict[str, list[Line]] = {}
    for source in summary.sources:
        for name, values in source.fields.items():
            if name in STATUS_FIELDS:
                continue
            running = source.running(name)
            columns = [("", running)] if values.ndim == 1 else [(f"[{i}]", c) for i, c in enumerate(running.T)]
            title = f"{name}, {source.units[name]}" if name in source.units else name
            panels.setdefault(title, []).extend(
                Line(f"{source.name}.{name}{index}", source.t_s, column) for index, column in columns
            )
    return [Panel(name, tuple(lines)) for name, lines in list(panels.items())[:MAX_PANELS]]


def choose_panels(summary: RunSummary) -> list[Panel]:
    """The panels of a run. Raises BagError if it has no outputs."""
    panels = _vehicle_panels(summary) + _attitude_panels(summary)
    panels = panels or _other_panels(summary)
    if not panels:
        raise BagError(f"machine `{summary.machine.name}` recorded no outputs to plot")
    return panels


def _draw_states(axes: Sequence[Any], summary: RunSummary, colours: dict[str, str]) -> None:
    for span in summary.spans:
        for axis in axes:
            axis.axvspan(span.start_s, span.end_s, color=colours[span.state], linewidth=0, zorder=0)
    whole = summary.spans[-1].end_s - summary.spans[0].start_s
    for i, span in enumerate(summary.spans):
        if i:
            for axis in axes:
                axis.axvline(span.start_s, color="#888888", linewidth=0.6, zorder=1)
        if span.end_s - span.start_s > 0.04 * whole:
            axes[0].text(
                (span.start_s + span.end_s) / 2,
                1.03,
                span.state,
                transform=axes[0].get_xaxis_transform(),
                ha="center",
                fontsize=8,
                color="#444444",
            )


def draw_panel(axis: Any, panel: Panel) -> None:
    """Draws the lines of a panel, truth on top."""
    plain = [line for line in panel.lines if not line.truth and not line.raw]
    for line in panel.lines:
        t_s, values = thinned(line.t_s, line.values, _POINTS)
        if np.isnan(values).all():
            continue
        if line.truth:
            axis.plot(t_s, values, color=_TRUTH_COLOUR, linewidth=1.6, label=line.label, zorder=4)
        elif line.raw:
            axis.plot(t_s, values, ".", color="#AAAAAA", markersize=1.6, label=line.label, zorder=2)
        else:
            # Later lines are thinner, so that coinciding lines stay visible.
            place = plain.index(line)
            width = 1.1 + (1.0 * (len(plain) - 1 - place) if len(plain) <= 4 else 0.0)
            colour = LINE_COLOURS[place % len(LINE_COLOURS)]
            axis.plot(t_s, values, color=colour, linewidth=width, label=line.label, zorder=5)
    axis.set_ylabel(panel.title)
    axis.grid(True, color="white", linewidth=0.8)
    axis.legend(loc="best", fontsize=8, framealpha=0.85)
    axis.margins(x=0)


def new_figure(panels: int, title: str) -> tuple[Any, list[Any]]:
    """A matplotlib figure with one set of axes per panel, one above the other, over the same time."""
    figure, grid = pyplot.subplots(
        panels, 1, sharex=True, squeeze=False, figsize=(11, 1.2 + 2.3 * panels), layout="constrained"
    )
    axes = list(grid[:, 0])
    axes[-1].set_xlabel("time, s")
    figure.align_ylabels(axes)
    figure.suptitle(title, fontsize=11)
    return figure, axes


def draw(summary: RunSummary, title: str) -> Any:
    """The matplotlib figure of a run."""
    panels = choose_panels(summary)
    figure, axes = new_figure(len(panels), title)
    colours = {state: STATE_COLOURS[i % len(STATE_COLOURS)] for i, state in enumerate(summary.states)}
    if summary.spans:
        _draw_states(axes, summary, colours)
    for axis, panel in zip(axes, panels, strict=True):
        draw_panel(axis, panel)
    return figure


def plot(bag: str | Path | Bag, output: str | Path, machine: str = "", truth: str = "") -> None:
    """Writes the picture of a run to `output` (.png, .svg or .pdf), complete or not at all. Raises BagError."""
    if Path(output).suffix.lower() not in SUFFIXES:
        raise BagError(f"{output}: the name of a picture ends in {', '.join(SUFFIXES)}")
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    summary = read_summary(opened, machine, truth)
    duration = summary.spans[-1].end_s - summary.spans[0].start_s if summary.spans else 0.0
    cut = " (incomplete)" if opened.truncated else ""
    figure = draw(summary, f"{summary.machine.name}, {duration:.2f} s: {opened.path.name}{cut}")
    try:
        save(figure, output)
    finally:
        pyplot.close(figure)


def save(figure: Any, output: str | Path) -> None:
    """Writes a figure, complete or not at all. Raises BagError.

    It is drawn in memory: matplotlib's PDF writer fails a second time when it cleans up after a full disk.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format=Path(output).suffix[1:].lower(), dpi=_DPI)
    with complete_or_absent(output) as partial:
        partial.write_bytes(drawn.getbuffer())
