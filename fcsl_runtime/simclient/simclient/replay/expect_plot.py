# SPDX-License-Identifier: Apache-2.0
"""A picture of expectations: values of machine and bag in one panel, their difference below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import BagError
from ..view.picture import SUFFIXES, Line, draw_panel, new_figure, pyplot, save
from ..view.rotation import ANGLES, euler_deg, unjoined
from .expect import Comparison
from .tick_alignment import Array

#: With the bag's values these are 8 curves, as many as have colours of their own.
_MAX_ELEMENTS = 4


class _Panel(NamedTuple):
    """Lines over the same time; `states` are names of the values 0, 1, 2, ..."""

    name: str
    lines: list[Line]
    states: tuple[str, ...] = ()


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
            draw_panel(axis, panel.name, panel.lines)
            if panel.states:
                axis.set_yticks(range(len(panel.states)), panel.states)
        save(figure, output)
    finally:
        pyplot.close(figure)


def _panels(c: Comparison) -> list[_Panel]:
    name, topic = c.target.expectation.entry.target, c.target.expectation.entry.topic
    if c.target.measure == "state":
        states = sorted({*c.ours.tolist(), *c.theirs.tolist()})
        numbers = [np.searchsorted(states, texts).astype(float) for texts in (c.ours, c.theirs)]
        return [_both("state", c.t_s, name, topic, [("", numbers[0], numbers[1])], tuple(states))]
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


def _both(
    title: str,
    t_s: Array,
    name: str,
    topic: str,
    pairs: Sequence[tuple[str, Array, Array]],
    states: tuple[str, ...] = (),
) -> _Panel:
    bag = [Line(f"{topic}{index} (bag)", t_s, theirs, "truth", bool(states)) for index, _, theirs in pairs]
    ours = [Line(f"{name}{index}", t_s, values, "estimate", bool(states)) for index, values, _ in pairs]
    return _Panel(title, [*bag, *ours], states)


def _apart(c: Comparison, scale: float, unit: str) -> _Panel:
    """The largest error of the elements, and the tolerance if it is constant."""
    lines = [Line("error", c.t_s, c.error * scale)]
    wanted = c.target.expectation
    if not wanted.relative:
        lines.append(Line("tolerance", c.t_s, np.full(len(c.t_s), wanted.absolute * scale), "command"))
    return _Panel(f"{c.target.measure} apart{unit}", lines)
