# SPDX-License-Identifier: Apache-2.0
"""Reads samples from ROS 2 messages: a native plan (fcsl/fcsl_ros.h) maps message fields to values."""

from __future__ import annotations

import contextlib
import ctypes
import weakref
from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass
from typing import Any

import numpy as np

from fcsl_compiler.config.message_fields import FieldError, Kind, Piece, Selection, numbers_text, select
from fcsl_compiler.config.standard_messages import GUARDS, Definitions, short_name

from ..c_run import CError
from ..errors import MapError, TwinError
from . import axes, native
from .native import CGuard, CPart, CPick, CReaderPlan, CRow, CTerm, CValue
from .rows import Place, Rows, array_of, select_all
from .walk import Walk

#: Names of fcsl_ros_status_t.
REASONS = native.REASONS

_DTYPES = {"bool": "?", "i32": "<i4", "u32": "<u4", "i64": "<i8", "u64": "<u8", "f32": "<f4", "f64": "<f8"}
_DTYPES |= dict.fromkeys(("TransitionRequest", "Health", "state"), "<i4")
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")


@dataclass(frozen=True)
class Pick:
    """The source of one value: `fields` of the message become `count` scalars of `type`, in a column called `name`.

    `fields`: paths such as "angular_velocity", "axes[1]", "position[left_wheel]", whose numbers are concatenated.
    `axes`: the axes of the value, `source_axes` those of the message; the empty string means ROS's axes. `order`:
    "xyzw" or "wxyz", for four numbers that are a quaternion in the message; the value is always w, x, y, z. A
    geometry_msgs/Quaternion needs none. `scale`, `offset`: none, one, or one per scalar; applied last.
    """

    name: str
    fields: tuple[str, ...]
    type: str
    count: int = 1
    axes: str = ""
    source_axes: str = ""
    order: str = ""
    scale: tuple[float, ...] = ()
    offset: tuple[float, ...] = ()


@dataclass(frozen=True)
class Samples:
    """The values read from n messages with m picks.

    `values`: structured array (n,), a column per pick. `stamps`: (n,), header stamps in ns, zeros for a type without a
    header. `status`: (n, m), an index into REASONS for each value; where it is not 0, the value is zero.
    """

    values: np.ndarray[Any, Any]
    stamps: np.ndarray[Any, Any]
    status: np.ndarray[Any, Any]


class Reader:
    """Reads the picks from messages of one type."""

    def __init__(
        self, definitions: Definitions, message: str, picks: Sequence[Pick], frame: str = "", child_frame: str = ""
    ):
        """`message`: full name of the type. `frame`, `child_frame`: required header.frame_id and child_frame_id (empty:
        any).

        Raises MapError, which names the pick that does not fit the message and why.
        """
        if message not in definitions:
            raise MapError(f"there is no definition of message type `{short_name(message)}`")
        selections = [_selection(definitions, message, pick) for pick in picks]
        header = next((m for m in definitions[message] if m.name == "header"), None)
        self.has_stamp = header is not None and header.type == "std_msgs/msg/Header"
        guards = [_guards(definitions, message, pick) for pick in picks]
        stamps = [select(definitions, message, path).pieces[0] for path in _STAMP] if self.has_stamp else []
        wanted = [piece for selection in selections for piece in selection.pieces]
        wanted += [*stamps, *(piece for found in guards for piece, _ in found)]
        strings = {"header.frame_id": frame, "child_frame_id": child_frame}
        self._walk = Walk(definitions, message, wanted, {path: text for path, text in strings.items() if text})
        self.dtype = _dtype(picks)
        plan = self._plan(picks, selections, guards, stamps)
        library, error = native.library(), CError()
        handle = library.fcsl_ros_reader_new(byref(plan), byref(error))
        if not handle:
            raise TwinError(error.text.decode("utf-8", "replace"))
        self._handle: int = handle
        self._read_many = library.fcsl_ros_read_many
        self._value_count = len(picks)
        weakref.finalize(self, library.fcsl_ros_reader_free, handle)

    @property
    def handle(self) -> int:
        """The address of the fcsl_ros_reader_t, which is valid as long as this object."""
        return self._handle

    def _places(self, piece: Piece) -> list[Place]:
        return array_of(*self._walk.places[piece], native.WIRE[piece.type], piece.count)

    def _plan(
        self,
        picks: Sequence[Pick],
        selections: Sequence[Selection],
        guards: Sequence[Sequence[tuple[Piece, float]]],
        stamps: Sequence[Piece],
    ) -> CReaderPlan:
        rows = Rows()
        values: list[CValue] = []
        all_guards: list[CGuard] = []
        for pick, selection, found in zip(picks, selections, guards, strict=True):
            type_ = native.MEMORY[pick.type]
            at = self.dtype.fields[pick.name][1]  # type: ignore[index]
            size = native.SIZES[type_]
            values.append(CValue(at, size * pick.count, len(rows.rows), pick.count, len(all_guards), len(found)))
            sources = [place for piece in selection.pieces for place in self._places(piece)]
            targets = [(at + size * i, type_) for i in range(pick.count)]
            rows.add(_matrix(pick, selection), sources, targets, pick.scale, pick.offset)
            all_guards += [CGuard(self._places(piece)[0].term(), value) for piece, value in found]
        walk = self._walk
        stamp = walk.places[stamps[0]] if stamps else (native.NONE, 0)
        table = native.table
        return CReaderPlan(
            parts=table(CPart, walk.parts),
            picks=table(CPick, walk.picks),
            names=table(ctypes.c_char_p, walk.names),
            values=table(CValue, values),
            rows=table(CRow, rows.rows),
            terms=table(CTerm, rows.terms),
            guards=table(CGuard, all_guards),
            part_count=len(walk.parts),
            pick_count=len(walk.picks),
            name_count=len(walk.names),
            value_count=len(values),
            row_count=len(rows.rows),
            term_count=len(rows.terms),
            guard_count=len(all_guards),
            anchor_count=walk.anchor_count,
            size=self.dtype.itemsize,
            stamp_anchor=stamp[0],
            stamp_offset=stamp[1],
        )

    def read_many(self, buffer: Any, offsets: Any, sizes: Any) -> Samples:
        """Reads the messages at `offsets` in `buffer` with `sizes` in bytes, encapsulation included.

        `buffer` supports the buffer protocol and is not copied; the other two are sequences of integers.
        """
        data = np.frombuffer(buffer, dtype=np.uint8)
        starts = np.ascontiguousarray(offsets, dtype=np.int64)
        lengths = np.ascontiguousarray(sizes, dtype=np.int64)
        count = len(starts)
        if lengths.shape != (count,):
            raise ValueError(f"{count} offsets, {len(lengths)} sizes")
        values = np.empty(count, dtype=self.dtype)
        stamps = np.empty(count, dtype=np.int64)
        status = np.empty((count, self._value_count), dtype=np.uint8)
        bases = (array.ctypes.data for array in (values, status, stamps))
        self._read_many(
            self._handle, data.ctypes.data, len(data), starts.ctypes.data, lengths.ctypes.data, count, *bases
        )
        return Samples(values, stamps, status)


def _dtype(picks: Sequence[Pick]) -> np.dtype[Any]:
    return np.dtype([(p.name, _DTYPES[p.type], (p.count,) if p.count > 1 else ()) for p in picks], align=True)


def _selection(definitions: Definitions, message: str, pick: Pick) -> Selection:
    """The numbers that the pick selects, with their kind; checks the pick's own options."""
    try:
        selection = select_all(definitions, message, pick.fields, pick.count)
    except MapError as error:
        raise MapError(f"`{pick.name}`: {error}") from None
    for what, numbers in (("scale", pick.scale), ("offset", pick.offset)):
        if len(numbers) not in (0, 1, pick.count):
            raise MapError(f"`{pick.name}`: `{what}` has {numbers_text(len(numbers))}; it takes 1 or {pick.count}")
    if pick.order and pick.count != 4:
        raise MapError(f"`{pick.name}`: a quaternion has 4 numbers, not {pick.count}")
    if pick.order == "wxyz" and selection.kind is Kind.QUATERNION:
        raise MapError(f"`{pick.name}`: a geometry_msgs/Quaternion is in the order x, y, z, w, not w, x, y, z")
    return selection


def _matrix(pick: Pick, selection: Selection) -> axes.Matrix:
    """The matrix from the numbers of the message to those of the value. Raises MapError."""
    is_quaternion = selection.kind is Kind.QUATERNION or bool(pick.order)
    kind = Kind.QUATERNION if is_quaternion else selection.kind
    try:
        matrix = axes.conversion(kind, pick.count, pick.source_axes, pick.axes)
    except axes.AxesError as error:
        raise MapError(f"`{pick.name}`: {error}") from None
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
