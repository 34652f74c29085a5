# SPDX-License-Identifier: Apache-2.0
"""Writes a laid-out picture as SVG. All text is in filled boxes, so that it is legible on light and dark
backgrounds."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from .layout import CHAR, MARGIN, PAD, ROW, SMALL, STUB, Layout, Placed, Point, header_rows, lay_out, tag_width
from .model import Picture, Row, Wire, legend

#: Colours of wires, by source, with sufficient contrast on both backgrounds.
_COLOURS = ("#1f77b4", "#d2691e", "#2e8b57", "#b5396b", "#7b5ea7", "#8a6d3b", "#008b8b", "#5b6b7b")
_FILL = {
    **{"instance": "#f6f8fa", "state": "#f6f8fa", "always": "#eef5e6", "any": "#f6f8fa"},
    **{"channel": "#fdf0c8", "transition": "#e8ecf0"},
}
_TAG_FILL = {"host": "#dcebfb", "machine": "#e6e6e6", "channel": "#fdf0c8", "initial": "#d9f0dd"}
_INK, _NOTE, _EDGE, _HEADER = "#1f2328", "#57606a", "#7d8590", "#dde3ea"
_RADIUS = 5
#: Of a sign in the legend; its height is ROW.
_SIGN = 28


def draw(pictures: Sequence[Picture]) -> str:
    """All pictures below one another, as one SVG document."""
    layouts = [lay_out(p) for p in pictures]
    width = max([*(p.width for p in layouts), *(_caption_width(p) + 2 * MARGIN for p in layouts)])
    width = max([width, *(_sign_width(text) + 2 * MARGIN for p in pictures for _, text in legend(p))])
    out: list[str] = []
    top = 0.0
    for layout in layouts:
        out.append(f'<g transform="translate(0 {_number(top)})">')
        out += _picture(layout)
        signs, height = _legend(layout.picture, width)
        out += [f'<g transform="translate(0 {_number(layout.height)})">', *signs, "</g></g>"]
        top += layout.height + height + MARGIN
    size = f'width="{_number(width)}" height="{_number(top)}" viewBox="0 0 {_number(width)} {_number(top)}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="DejaVu Sans Mono, Menlo, Consolas, monospace">'
    return "\n".join([head, *out, "</svg>"]) + "\n"


def _picture(layout: Layout) -> list[str]:
    out = [_rect(MARGIN, 4, _caption_width(layout), 20, "#f6f8fa", 10)]
    out.append(_text(MARGIN + _caption_width(layout) / 2, 18, layout.picture.caption, _INK, anchor="middle", bold=True))
    for number, path in enumerate(layout.paths):
        wire = layout.picture.wires[number]
        dash = ' stroke-dasharray="5 3"' if wire.dashed else ""
        out.append(
            f'<path d="{_rounded(path)}" fill="none" stroke="{_colour(layout.picture, wire)}" stroke-width="1.4"{dash}/>'
        )
    for (x, y), number in layout.dots:
        colour = _colour(layout.picture, layout.picture.wires[number])
        out.append(f'<circle cx="{_number(x)}" cy="{_number(y)}" r="2.6" fill="{colour}"/>')
    for number, path in enumerate(layout.paths):
        out.append(_arrow(path[-1], _colour(layout.picture, layout.picture.wires[number])))
    for placed in layout.boxes:
        out += _box(placed)
    return out


def _legend(picture: Picture, width: float) -> tuple[list[str], float]:
    """The signs of a picture with their meanings, in lines of this width, and the height of all."""
    out: list[str] = []
    x, y = float(MARGIN), 0.0
    for sign, meaning in legend(picture):
        size = _sign_width(meaning)
        if x > MARGIN and x + size > width:
            x, y = float(MARGIN), y + ROW
        out.append(_rect(x, y + 2, size - PAD, ROW - 4, "#f6f8fa", 3, "none", 0))
        out += _sign(sign, x + PAD / 2, y + ROW / 2)
        out.append(_text(x + _SIGN + PAD, y + ROW / 2 + 3.5, meaning, _NOTE, 10))
        x += size
    return out, y + ROW


def _sign_width(meaning: str) -> float:
    return _SIGN + len(meaning) * SMALL + 3 * PAD


def _sign(sign: str, x: float, y: float) -> list[str]:
    if sign in ("wire", "dashed"):
        dash = ' stroke-dasharray="5 3"' if sign == "dashed" else ""
        end = x + _SIGN
        line = f'<path d="M{_number(x)} {_number(y)}H{_number(end)}" fill="none" stroke="{_COLOURS[0]}" stroke-width="1.4"{dash}/>'
        return [line, _arrow((end, y), _COLOURS[0])]
    fill = _FILL.get(sign) or _TAG_FILL.get(sign) or _FILL["state"]
    stroke, pen = (_INK, 2.4) if sign == "strong" else (_EDGE, 1.2)
    box = _rect(x, y - 6, _SIGN - 2, 12, fill, 3 if sign in ("instance", "dim") else 6, stroke, pen)
    return [f'<g opacity="0.55">{box}</g>' if sign == "dim" else box]


def _caption_width(layout: Layout) -> float:
    return len(layout.picture.caption) * CHAR + 20


def _box(p: Placed) -> list[str]:
    box = p.box
    assert box is not None
    radius = {"channel": 10, "transition": 10, "state": 8, "always": 8, "any": 8}.get(box.kind, 3)
    out = ['<g opacity="0.55">' if box.dim else "<g>"]
    stroke, width = (_INK, 2.4) if box.strong else (_EDGE, 1.2)
    out.append(_rect(p.x, p.y, p.width, p.height, _FILL[box.kind], radius, stroke, width))
    header = header_rows(box)
    if header:
        out.append(_rect(p.x + 1, p.y + 1, p.width - 2, header * ROW - 1, _HEADER, radius - 1, "none"))
        out.append(_text(p.x + p.width / 2, p.y + 15, box.title, _INK, anchor="middle", bold=True))
    if box.subtitle:
        out.append(_text(p.x + p.width / 2, p.y + 31, box.subtitle, _NOTE, 10, anchor="middle"))
    if box.calls:
        out.append(_text(p.x + p.width / 2, p.y + 49, box.calls, _NOTE, 10, anchor="middle"))
    for number, row in enumerate(box.rows):
        out += _row(p, row, p.row_y(number))
    out.append("</g>")
    return out


def _row(p: Placed, row: Row, y: float) -> list[str]:
    out: list[str] = []
    if p.box is not None and p.box.kind in ("channel", "transition", "any"):
        return [_text(p.x + p.width / 2, y + 4, row.left or row.right, _INK, anchor="middle")]
    if row.left:
        out.append(_text(p.x + PAD, y + 4, row.left, _INK))
        out.append(_text(p.x + PAD + (len(row.left) + 1) * CHAR - 1, y + 4, row.left_note, _NOTE, 10))
    if row.right:
        out.append(_text(p.x + p.width - PAD, y + 4, row.right, _INK, anchor="end"))
        out.append(
            _text(p.x + p.width - PAD - (len(row.right) + 1) * CHAR + 1, y + 4, row.right_note, _NOTE, 10, "end")
        )
    if row.tag:
        width = tag_width(row.tag)
        left = p.x - STUB - width
        out.append(_rect(left, y - 7, width, 14, _TAG_FILL[row.tag_kind], 7))
        out.append(_text(left + width / 2, y + 3.5, row.tag, _INK, 10, anchor="middle"))
        out.append(
            f'<path d="M{_number(p.x - STUB)} {_number(y)}H{_number(p.x)}" stroke="{_EDGE}" stroke-width="1.4"/>'
        )
        out.append(_arrow((p.x, y), _EDGE))
    return [line for line in out if line]


def _colour(picture: Picture, wire: Wire) -> str:
    leaves = picture.boxes[wire.source].colour_of
    return _COLOURS[(wire.source if leaves < 0 else leaves) % len(_COLOURS)]


def _arrow(tip: Point, colour: str) -> str:
    x, y = tip
    return f'<path d="M{_number(x)} {_number(y)}l-7 -3.5v7z" fill="{colour}"/>'


def _rounded(points: list[Point]) -> str:
    """A path through the points with rounded corners."""
    points = [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]
    out = [f"M{_number(points[0][0])} {_number(points[0][1])}"]
    for before, (x, y), after in zip(points, points[1:], points[2:], strict=False):
        (ax, ay), (bx, by) = _towards((x, y), before), _towards((x, y), after)
        out.append(f"L{_number(ax)} {_number(ay)}Q{_number(x)} {_number(y)} {_number(bx)} {_number(by)}")
    out.append(f"L{_number(points[-1][0])} {_number(points[-1][1])}")
    return "".join(out)


def _towards(at: Point, other: Point) -> Point:
    dx, dy = other[0] - at[0], other[1] - at[1]
    length = abs(dx) + abs(dy)
    step = min(_RADIUS, length / 2)
    return (at[0] + dx / length * step, at[1] + dy / length * step)


def _rect(
    x: float, y: float, width: float, height: float, fill: str, radius: float, stroke: str = _EDGE, pen: float = 1.2
) -> str:
    place = (
        f'x="{_number(x)}" y="{_number(y)}" width="{_number(width)}" height="{_number(height)}" rx="{_number(radius)}"'
    )
    return f'<rect {place} fill="{fill}" stroke="{stroke}" stroke-width="{pen}"/>'


def _text(x: float, y: float, text: str, fill: str, size: int = 12, anchor: str = "start", bold: bool = False) -> str:
    if not text:
        return ""
    width = len(text) * (CHAR if size == 12 else SMALL)
    more = f' text-anchor="{anchor}"' if anchor != "start" else ""
    more += ' font-weight="bold"' if bold else ""
    # textLength fixes the width that the layout assumed, independent of the font.
    length = f'textLength="{_number(width - 1)}" lengthAdjust="spacingAndGlyphs"'
    return (
        f'<text x="{_number(x)}" y="{_number(y)}" font-size="{size}" fill="{fill}" {length}{more}>{escape(text)}</text>'
    )


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")
