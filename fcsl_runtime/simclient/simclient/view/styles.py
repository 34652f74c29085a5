# SPDX-License-Identifier: Apache-2.0
"""How curves look, in pictures and in rerun alike: a colour for each of a panel, a style for each role."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: The eight-colour sequence of M. Petroff, "Accessible Color Sequences for Data Visualization" (arXiv:2107.02270): any
#: two differ with every common colour blindness and in print. Its red comes last, because rerun's truth is red.
COLOURS = ("#1845FB", "#FF5E02", "#86C8DD", "#C849A9", "#ADAD7D", "#578DFF", "#656364", "#C91F16")
#: Truth is drawn on top of what it judges: thin, in greys from black; red in rerun, whose background may be black.
_TRUTH = ("#000000", "#5A5A5A", "#8F8F8F", "#B5B5B5")
_TRUTH_IN_RERUN = ("#E12D46", "#FF8FA0", "#9E1029", "#FFC7CF")


#: Widths of solid lines, in points: later ones are thinner, so that lines that coincide stay visible.
_WIDEST, _THINNEST, _THINNER = 2.0, 1.0, 0.3
#: From the back to the front.
_ORDER = ("measured", "estimate", "values", "command", "truth")


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
    """The styles of a panel's curves (8 at most), given their roles; no two have one colour."""
    found: dict[int, Style] = {}
    truths = [i for i, role in enumerate(roles) if role == "truth"][: len(_TRUTH)]
    for (colour, in_rerun), i in zip(zip(_TRUTH, _TRUTH_IN_RERUN, strict=True), truths, strict=False):
        found[i] = Style(colour, in_rerun, _THINNEST, False, False, _ORDER.index("truth") + 2)
    # Dots take the last colours, so that estimates have the same ones with and without measurements.
    others = sorted((i for i in range(len(roles)) if i not in found), key=lambda i: roles[i] == "measured")
    for nth, i in enumerate(others):
        colour, role = COLOURS[nth % len(COLOURS)], roles[i]
        width = _THINNEST if role in ("truth", "command") else max(_THINNEST, _WIDEST - _THINNER * nth)
        found[i] = Style(colour, colour, width, role == "measured", role == "command", _ORDER.index(role) + 2)
    return [found[i] for i in range(len(roles))]


def rgba(colour: str) -> list[int]:
    """`#RRGGBB` as four numbers from 0 to 255, opaque."""
    return [*bytes.fromhex(colour[1:]), 255]
