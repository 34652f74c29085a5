# SPDX-License-Identifier: Apache-2.0
"""Writes pictures as a Mermaid flowchart, a text format that GitHub and many editors display."""

from __future__ import annotations

from collections.abc import Sequence

from .model import Box, Picture, Row, legend

_ESCAPES = {"#": "#35;", '"': "#quot;", "<": "#lt;", ">": "#gt;"}


def write(pictures: Sequence[Picture]) -> str:
    """All pictures as subgraphs of one flowchart."""
    lines = ["flowchart LR"]
    for number, picture in enumerate(pictures):
        lines.append(f'  subgraph p{number}["{_quoted(picture.caption)}"]')
        lines += [f"    {line}" for line in _picture(picture, f"p{number}_")]
        lines.append("  end")
    return "\n".join(lines) + "\n"


def _picture(picture: Picture, prefix: str) -> list[str]:
    lines: list[str] = []
    tags: dict[str, str] = {}
    for n, box in enumerate(picture.boxes):
        if box.kind == "transition":
            continue
        lines.append(f"{prefix}b{n}{_shape(box)}")
    for n, box in enumerate(picture.boxes):
        for row in box.rows:
            if not row.tag:
                continue
            if row.tag not in tags:
                tags[row.tag] = f"{prefix}t{len(tags)}"
                lines.append(f'{tags[row.tag]}(["{_quoted(row.tag)}"])')
            label = "" if row.tag_kind == "initial" else f'|"{_quoted(_entered(row))}"|'
            lines.append(f"{tags[row.tag]} -->{label} {prefix}b{n}")
    return [*lines, *_wires(picture, prefix), *_legend(picture, prefix)]


#: How Mermaid draws the signs of a legend that need words.
_SIGNS = {"channel": "(channel)", "host": "(host)", "machine": "(machine.…)", "dashed": "⇢", "always": "every state"}


def _legend(picture: Picture, prefix: str) -> list[str]:
    lines = [_quoted(f"{_SIGNS[sign]}: {meaning}") for sign, meaning in legend(picture) if sign in _SIGNS]
    return [f'{prefix}legend["{"<br/>".join(lines)}"]'] if lines else []


def _wires(picture: Picture, prefix: str) -> list[str]:
    """One arrow per pair of boxes and style, with one line of label per wire. A transition is the label of its
    arrow."""
    leaves = {w.target: w.source for w in picture.wires if picture.boxes[w.target].kind == "transition"}
    arrows: dict[tuple[int, int, bool], list[str]] = {}
    for w in picture.wires:
        source, target = picture.boxes[w.source], picture.boxes[w.target]
        if target.kind == "transition":
            continue
        if source.kind == "transition":
            arrows.setdefault((leaves[w.source], w.target, False), []).append(source.rows[0].left)
            continue
        leaving, entering = source.rows[w.source_row], target.rows[w.target_row]
        label = f"{leaving.right} {leaving.right_note}".strip()
        if target.kind == "instance" and entering.left != leaving.right:
            label += f" → {entering.left}"
        arrows.setdefault((w.source, w.target, w.dashed), []).append(label)
    return [
        f'{prefix}b{source} {"-.->" if dashed else "-->"}|"{_lines(labels)}"| {prefix}b{target}'
        for (source, target, dashed), labels in arrows.items()
    ]


def _shape(box: Box) -> str:
    if box.kind in ("channel", "any"):
        return f'(["{_lines([box.rows[0].left or box.rows[0].right])}"])'
    lines = [f"<b>{_quoted(box.title)}</b>"]
    if box.subtitle:
        lines.append(_quoted(box.subtitle))
    if box.calls:
        lines.append(_quoted(box.calls))
    if box.kind in ("state", "always"):
        lines += [_quoted(f"{row.left} {row.left_note}") for row in box.rows if row.left]
        return f'("{"<br/>".join(lines)}")'
    return f'["{"<br/>".join(lines)}"]'


def _entered(row: Row) -> str:
    return f"{row.left} {row.left_note}".strip() or f"{row.right} {row.right_note}".strip()


def _lines(labels: list[str]) -> str:
    return "<br/>".join(map(_quoted, labels))


def _quoted(text: str) -> str:
    return "".join(_ESCAPES.get(char, char) for char in text)
