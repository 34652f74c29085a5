# SPDX-License-Identifier: Apache-2.0
"""A picture of expectations: values of machine and bag in one panel, their difference below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import BagError
from ..view.picture import SUFFIXES, Line, Panel, draw_panel, new_figure, pyplot, save, unjoined
from ..view.summary import ANGLES, euler_deg
from .expect import Comparison
from .grid import Array

_MAX_ELEMENTS = 6


def check_name(output: str | Path) -> None:
    """Raises BagError if the suffix is not that of a picture."""
    if Path(output).suffix.lower() not in SUFFIXES:
        raise BagError(f"{output}: the name of a picture ends in {', '.join(SUFFIXES)}")


def plot(comparisons: Sequence[Comparison], title: str, output: str | Path) -> None:
    """Writes the picture, complete or not at all. Raises BagError."""
    check_name(output)
    panels = [panel for comparison in comparisons for panel in _panels(comparison)]
    figure, axes = new_figure(len(panels), title)
    try:
        for axis, panel in zip(axes, panels, strict=True):
            draw_panel(axis, panel)
        save(figure, output)
    finally:
        pyplot.close(figure)


def _panels(c: Comparison) -> list[Panel]:
    name, topic = c.target.expectation.entry.target, c.target.expectation.entry.topic
    if c.target.measure == "state":
        states = sorted({*c.ours.tolist(), *c.theirs.tolist()})
        numbers = [np.searchsorted(states, texts).astype(float) for texts in (c.ours, c.theirs)]
        title = ", ".join(f"{i} {state}" for i, state in enumerate(states))
        return [_both(f"state ({title})", c.t_s, name, topic, [("", numbers[0], numbers[1])])]
    if c.target.measure == "values":
        count = min(c.ours.shape[1], _MAX_ELEMENTS)
        pairs = [(f"[{i}]" if count > 1 else "", c.ours[:, i], c.theirs[:, i]) for i in range(count)]
        field = name.rpartition(".")[2]
        unit = f", {c.target.unit}" if c.target.unit else ""
        return [_both(field + unit, c.t_s, name, topic, pairs), _apart(c, 1.0, unit)]
    angles = [(unjoined(euler_deg(c.ours)[:, i]), unjoined(euler_deg(c.theirs)[:, i])) for i in range(3)]
    shown = ANGLES[:2] if c.target.measure == "tilt" else ANGLES
    panels = [_both(f"{t}, deg", c.t_s, name, topic, [("", *pair)]) for t, pair in zip(shown, angles, strict=False)]
    return [*panels, _apart(c, 180.0 / np.pi, ", deg")]


def _both(title: str, t_s: Array, name: str, topic: str, pairs: Sequence[tuple[str, Array, Array]]) -> Panel:
    bag = [Line(f"{topic}{index}", t_s, theirs, truth=True) for index, _, theirs in pairs]
    return Panel(title, (*bag, *(Line(f"{name}{index}", t_s, ours) for index, ours, _ in pairs)))


def _apart(c: Comparison, scale: float, unit: str) -> Panel:
    """The largest error of the elements, and the tolerance if it is constant."""
    lines = [Line("error", c.t_s, c.error * scale)]
    wanted = c.target.expectation
    if not wanted.relative:
        lines.append(Line("tolerance", c.t_s, np.full(len(c.t_s), wanted.absolute * scale)))
    return Panel(f"{c.target.measure} apart{unit}", tuple(lines))
