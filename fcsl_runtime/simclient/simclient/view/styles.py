# SPDX-License-Identifier: Apache-2.0
"""How curves look, in pictures and in rerun alike: a colour for each of a panel, a style for each role."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: The eight-colour sequence of M. Petroff, "Accessible Color Sequences for Data Visualization" (arXiv:2107.02270): any
#: two differ with every common colour blindness and in print. Its red comes late, because rerun's truth is red. Lines
#: take them from the front, dots from the back.
COLOURS = ("#1845FB", "#FF5E02", "#86C8DD", "#C849A9", "#ADAD7D", "#578DFF", "#C91F16", "#656364")
#: Truth is drawn on top of what it judges: thin, in greys from black; red in rerun, whose background may be black.
_TRUTH = ("#000000", "#5A5A5A", "#8F8F8F", "#B5B5B5")
_TRUTH_IN_RERUN = ("#E12D46", "#FF8FA0", "#9E1029", "#FFC7CF")

#: Role of what passed a gate: a broad band behind its command, so that one sees where it is not the command.
AFTER_GATE = "after the gate"
_BAND, _BAND_WIDTH = "#9AA0A6", 4.0
#: Widths of solid lines, in points: later ones are thinner, so that lines that coincide stay visible.
_WIDEST, _THINNEST, _THINNER = 2.0, 1.0, 0.3
#: From the back to the front.
_ORDER = (AFTER_GATE, "measured", "estimate", "values", "command", "truth")
#: Paler in rerun, where they would be too dark.
_PALER = {"#1845FB": "#3D63FF", "#656364": "#A9A7A8"}


@dataclass(frozen=True)
class Style:
    """`colour` and `rerun_colour` as #RRGGBB; `width` in points; higher `order` is nearer to the front."""

    colour: str
    rerun_colour: str
    width: float
    dots: bool
    dashed: bool
    order: int


def styles(roles: Sequence[str]) -> list[Style]:
    """The styles of a panel's curves, given their roles. No two have one colour, except for bands; beside them, 8 curves
    at most."""
    found: dict[int, Style] = {}
    truths = [i for i, role in enumerate(roles) if role == "truth"][: len(_TRUTH)]
    for (colour, in_rerun), i in zip(zip(_TRUTH, _TRUTH_IN_RERUN, strict=True), truths, strict=False):
        found[i] = Style(colour, in_rerun, _THINNEST, False, False, _ORDER.index("truth") + 2)
    lines, dots = 0, 0
    for i, role in enumerate(roles):
        if i in found:
            continue
        if role == AFTER_GATE:
            found[i] = Style(_BAND, _BAND, _BAND_WIDTH, False, False, _ORDER.index(role) + 2)
            continue
        if role == "measured":
            dots += 1
            found[i] = Style(COLOURS[-dots], _in_rerun(COLOURS[-dots]), _THINNEST, True, False, _ORDER.index(role) + 2)
            continue
        colour, nth, lines = COLOURS[lines], lines, lines + 1
        width = _THINNEST if role in ("truth", "command") else max(_THINNEST, _WIDEST - _THINNER * nth)
        found[i] = Style(colour, _in_rerun(colour), width, False, role == "command", _ORDER.index(role) + 2)
    return [found[i] for i in range(len(roles))]


def _in_rerun(colour: str) -> str:
    return _PALER.get(colour, colour)


def rgba(colour: str) -> list[int]:
    """`#RRGGBB` as four numbers from 0 to 255, opaque."""
    return [*bytes.fromhex(colour[1:]), 255]
