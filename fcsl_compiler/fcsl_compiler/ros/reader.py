# SPDX-License-Identifier: Apache-2.0
"""The conversion that reads samples from the messages of a type: fields become values in a row of memory."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

from . import axes
from .conversion import MEMORY, NONE, SIZES, WIRE, ConversionError, Guard, ReaderConversion, Value
from .message_fields import LENGTH, FieldError, Kind, Piece, Selection, numbers_text, select
from .rows import Choice, Place, Rows, array_of, select_all
from .standard_messages import GUARDS, Definitions, short_name
from .walk import Walk

#: What a walk finds in place of a string.
_INDEX = "uint32"
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")


@dataclass(frozen=True)
class Pick:
    """The source of one value: `fields` of the message become `count` scalars of `type`, in a column called `name`.

    `fields`: paths such as "angular_velocity", "axes[1]", "position[left_wheel]", whose numbers are concatenated.
    `axes`: the axes of the value, `source_axes` those of the message; the empty string means ROS's axes. `order`:
    "xyzw" or "wxyz", for four numbers that are a quaternion in the message; the value is always w, x, y, z. A
    geometry_msgs/Quaternion needs none. `rotation`: 3x3 row by row, from the axes of the sensor into those of its body,
    before the change of axes. `scale`, `offset`: none, one, or one per scalar; applied last. `null_refused`: a
    quaternion of length zero is no value. `choices`: the value is the index of what the message has (rows.Choice).
    `shorter`: a list may have fewer elements, as with its length among the picks; the others are 0.
    """

    name: str
    fields: tuple[str, ...]
    type: str
    count: int = 1
    axes: str = ""
    source_axes: str = ""
    order: str = ""
    rotation: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    offset: tuple[float, ...] = ()
    null_refused: bool = False
    choices: tuple[Choice, ...] = ()
    shorter: bool = False


def has_stamp(definitions: Definitions, message: str) -> bool:
    """Whether messages of the type begin with a header, whose stamp a reader reads."""
    header = next((m for m in definitions.get(message, ()) if m.name == "header"), None)
    return header is not None and header.type == "std_msgs/msg/Header"


def reader_conversion(
    definitions: Definitions, message: str, picks: Sequence[Pick], frame: str = "", child_frame: str = ""
) -> ReaderConversion:
    """`message`: full name of the type. `frame`, `child_frame`: required header.frame_id and child_frame_id (empty:
    any). The values stand in the order of the picks, each aligned to its scalar.

    Raises ConversionError, which names the pick that does not fit the message and why.
    """
    if message not in definitions:
        raise ConversionError(f"there is no definition of message type `{short_name(message)}`")
    selections = [_selection(definitions, message, pick) for pick in picks]
    guards = [_guards(definitions, message, pick) for pick in picks]
    stamps = (
        [select(definitions, message, path).pieces[0] for path in _STAMP] if has_stamp(definitions, message) else []
    )
    wanted = [piece for selection in selections for piece in selection.pieces]
    wanted += [*stamps, *(piece for found in guards for piece, _ in found)]
    strings = {"header.frame_id": frame, "child_frame_id": child_frame}
    texts = {
        selection.pieces[0].path: tuple(map(str, pick.choices))
        for pick, selection in zip(picks, selections, strict=True)
        if selection.kind is Kind.TEXT
    }
    limited = _limited(picks, selections)
    walk = Walk(definitions, message, wanted, {path: text for path, text in strings.items() if text}, texts, limited)
    return _conversion(walk, picks, selections, guards, stamps)


def _limited(picks: Sequence[Pick], selections: Sequence[Selection]) -> frozenset[str]:
    """The sequences that may be shorter than their values, because another value is their length."""
    lengths = {piece.path for selection in selections for piece in selection.pieces if piece.length}
    limited = set()
    for pick, selection in zip(picks, selections, strict=True):
        for piece in selection.pieces:
            if (pick.shorter or f"{piece.path}.{LENGTH}" in lengths) and piece.element is None:
                if pick.axes or pick.source_axes or pick.rotation or pick.order or len(selection.pieces) > 1:
                    raise ConversionError(f"`{pick.name}`: a list with a `.{LENGTH}` beside it is taken as it is")
                limited.add(piece.path)
    return frozenset(limited)


def _conversion(
    walk: Walk,
    picks: Sequence[Pick],
    selections: Sequence[Selection],
    guards: Sequence[Sequence[tuple[Piece, float]]],
    stamps: Sequence[Piece],
) -> ReaderConversion:
    rows, at, align = Rows(), 0, 1
    values: list[Value] = []
    all_guards: list[Guard] = []
    choices: list[int] = []
    for pick, selection, found in zip(picks, selections, guards, strict=True):
        type_ = MEMORY[pick.type]
        size = SIZES[type_]
        at, align = _aligned(at, size), max(align, size)
        first = len(rows.rows)
        sources = [place for piece in selection.pieces for place in _places(walk, piece)]
        targets = [(at + size * i, type_) for i in range(pick.count)]
        rows.add(_matrix(pick, selection), sources, targets, pick.scale, pick.offset)
        row_count = len(rows.rows) - first
        rotation = pick.null_refused and _is_rotation(pick, selection)
        is_limited = any(piece.path in walk.limited for piece in selection.pieces)
        numbers = [choice for choice in pick.choices if isinstance(choice, int)]
        first_choice = len(choices) if numbers else NONE
        values.append(
            Value(
                *(at, size * pick.count, first, row_count, len(all_guards), len(found), rotation),
                *(is_limited, first_choice, len(pick.choices)),
            )
        )
        choices += numbers
        all_guards += [Guard(_places(walk, piece)[0].term(), value) for piece, value in found]
        at += size * pick.count
    stamp_anchor, stamp_offset = walk.places[stamps[0]] if stamps else (NONE, 0)
    return ReaderConversion(
        parts=walk.parts,
        picks=walk.picks,
        names=walk.names,
        values=values,
        rows=rows.rows,
        terms=rows.terms,
        guards=all_guards,
        choices=choices,
        anchor_count=walk.anchor_count,
        size=_aligned(at, align),
        stamp_anchor=stamp_anchor,
        stamp_offset=stamp_offset,
    )


def _aligned(at: int, size: int) -> int:
    return -(-at // size) * size


def _places(walk: Walk, piece: Piece) -> list[Place]:
    return array_of(*walk.places[piece], WIRE[_INDEX if piece.type == "string" else piece.type], piece.count)


def _selection(definitions: Definitions, message: str, pick: Pick) -> Selection:
    """The numbers that the pick selects, with their kind; checks the pick's own options."""
    try:
        selection = select_all(definitions, message, pick.fields, pick.count, pick.choices)
    except ConversionError as error:
        raise ConversionError(f"`{pick.name}`: {error}") from None
    for what, numbers in (("scale", pick.scale), ("offset", pick.offset)):
        if len(numbers) not in (0, 1, pick.count):
            raise ConversionError(
                f"`{pick.name}`: `{what}` has {numbers_text(len(numbers))}; it takes 1 or {pick.count}"
            )
    if pick.order and pick.count != 4:
        raise ConversionError(f"`{pick.name}`: a quaternion has 4 numbers, not {pick.count}")
    if pick.order == "wxyz" and selection.kind is Kind.QUATERNION:
        raise ConversionError(f"`{pick.name}`: a geometry_msgs/Quaternion is in the order x, y, z, w, not w, x, y, z")
    return selection


def _is_rotation(pick: Pick, selection: Selection) -> bool:
    return selection.kind is Kind.QUATERNION or bool(pick.order)


def _matrix(pick: Pick, selection: Selection) -> axes.Matrix | None:
    """The matrix from the numbers of the message to those of the value, None where they are the same. Raises ConversionError."""
    is_quaternion = _is_rotation(pick, selection)
    if not is_quaternion and not (pick.source_axes or pick.axes or pick.rotation):
        return None
    kind = Kind.QUATERNION if is_quaternion else selection.kind
    try:
        matrix = axes.conversion(kind, pick.count, pick.source_axes, pick.axes)
        if pick.rotation:
            matrix = axes.product(matrix, axes.mounting(kind, pick.count, pick.rotation))
    except axes.AxesError as error:
        raise ConversionError(f"`{pick.name}`: {error}") from None
    if is_quaternion and pick.order != "wxyz":
        return axes.product(matrix, axes.permutation(axes.XYZW))
    return matrix


def _guards(definitions: Definitions, message: str, pick: Pick) -> list[tuple[Piece, float]]:
    """Numbers of the message and the values by which they mark a field of the pick as not measured."""
    found = []
    for guard in GUARDS.get(message, ()):
        guarded = any(
            field == group or field.startswith((group + ".", group + "["))
            for group in guard.groups
            for field in pick.fields
        )
        if guarded:
            with contextlib.suppress(FieldError):  # the bag's definition of that type may lack the field
                found.append((select(definitions, message, guard.field).pieces[0], guard.value))
    return found
