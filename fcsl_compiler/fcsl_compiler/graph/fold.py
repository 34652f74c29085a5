# SPDX-License-Identifier: Apache-2.0
"""Folds a picture: the instances of each part become one box, with what leaves or enters the part."""

from __future__ import annotations

from dataclasses import replace
from itertools import zip_longest

from .model import Box, Picture, Row, Wire


def fold(picture: Picture) -> Picture:
    """A picture of dataflow or states in which each part is one box, or one row of a state."""
    parts = [_part_of(box) for box in picture.boxes]
    places: dict[str, int] = {}
    folded = Picture(picture.caption)
    new: list[int] = []  # by old box
    for box, part in zip(picture.boxes, parts, strict=True):
        if part not in places:
            folded.boxes.append(Box(part, "instance", part) if part else replace(box, rows=_with_parts(box)))
        new.append(places.get(part, len(folded.boxes) - 1))
        if part:
            places.setdefault(part, len(folded.boxes) - 1)
    wires = [w for w in picture.wires if not parts[w.source] or parts[w.source] != parts[w.target]]
    rows = {(n, row): row for n, box in enumerate(picture.boxes) if not parts[n] for row in range(len(box.rows))}
    ends = dict(rows), dict(rows)
    for part, place in places.items():
        _fill(folded.boxes[place], [(n, picture.boxes[n]) for n, p in enumerate(parts) if p == part], wires, *ends)
    sources, targets = ends
    for w in wires:
        source, target = sources[w.source, w.source_row], targets[w.target, w.target_row]
        folded.wires.append(
            replace(w, source=new[w.source], source_row=source, target=new[w.target], target_row=target)
        )
        entered = folded.boxes[new[w.target]].rows  # of a state, which has fewer rows than before
        entered += [Row() for _ in range(target + 1 - len(entered))]
    return folded


def _part_of(box: Box) -> str:
    """The outermost part of an instance; "" for other boxes."""
    part, dot, _ = box.name.partition(".")
    return part if box.kind == "instance" and dot else ""


def _fill(
    box: Box,
    inner: list[tuple[int, Box]],
    wires: list[Wire],
    sources: dict[tuple[int, int], int],
    targets: dict[tuple[int, int], int],
) -> None:
    """Gives the box of a part the ports that wires from outside, hosts or channels use."""
    box.subtitle = f"{len(inner)} instance{'' if len(inner) == 1 else 's'}"
    box.dim = all(one.dim for _, one in inner)
    box.calls = "; ".join(one.calls for _, one in inner if one.calls)
    left: list[Row] = []
    right: list[Row] = []
    for n, one in inner:
        name = one.name.removeprefix(f"{box.name}.")
        for index, row in enumerate(one.rows):
            if any((w.target, w.target_row) == (n, index) for w in wires) or row.tag_kind in ("host", "channel"):
                targets[n, index] = len(left)
                left.append(replace(row, left=f"{name}.{row.left}" if row.left else "", right="", right_note=""))
            if any((w.source, w.source_row) == (n, index) for w in wires):
                sources[n, index] = len(right)
                right.append(Row(right=f"{name}.{row.right}", right_note=row.right_note))
    for entering, leaving in zip_longest(left, right, fillvalue=Row()):
        box.rows.append(replace(entering, right=leaving.right, right_note=leaving.right_note))


def _with_parts(box: Box) -> list[Row]:
    """The rows of a state, in which a part has one."""
    if box.kind not in ("state", "always"):
        return box.rows
    found: dict[str, Row] = {}
    rest: list[Row] = []
    for row in box.rows:
        part, dot, _ = row.left.partition(".")
        known = found.get(part) if dot else None
        if known is None:
            rest.append(replace(row, left=part, left_note="at its own rates") if dot else row)
            found |= {part: rest[-1]} if dot else {}
    return rest
