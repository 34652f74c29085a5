# SPDX-License-Identifier: Apache-2.0
"""Offsets of a ROS 2 message's fields in its CDR bytes, for types whose messages all have the same layout.

A machine's messages do: scalars, fixed arrays and a header with an empty frame_id. With a fixed layout thousands of
messages are converted to numpy columns at once. Types with sequences or non-empty strings are decoded one by one
(simclient.bag).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

Array = np.ndarray[Any, Any]

#: Size of the CDR representation header before every message; alignment counts from after it.
ENCAPSULATION = b"\x00\x01\x00\x00"
_HEAD = len(ENCAPSULATION)

#: ROS scalar to little-endian numpy type.
DTYPES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "<i2",
    "uint16": "<u2",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "uint64": "<u8",
    "float32": "<f4",
    "float64": "<f8",
}
_EMPTY_STRING = b"\x01\x00\x00\x00\x00"
#: Most members of a layout. Members repeat per element of a message array; two arrays of 100000 would give 10^10.
_MAX_MEMBERS = 1 << 18


@dataclass(frozen=True)
class Leaf:
    """A scalar (count 0) or a fixed array of `count` scalars at `offset` bytes in the message."""

    path: str
    ros_type: str
    count: int
    offset: int

    @property
    def dtype(self) -> np.dtype[Any]:
        return np.dtype((DTYPES[self.ros_type], (self.count,)) if self.count else DTYPES[self.ros_type])


class _VariableLayout(Exception):
    """The type has members whose size differs between messages, or too many members."""


class Layout:
    """The fixed layout of one message type."""

    def __init__(self, leaves: Sequence[Leaf], strings: Sequence[int], size: int):
        self.leaves = {leaf.path: leaf for leaf in leaves}
        self.size = size
        self._strings = tuple(strings)
        self.dtype = np.dtype(
            {
                "names": list(self.leaves),
                "formats": [leaf.dtype for leaf in leaves],
                "offsets": [leaf.offset for leaf in leaves],
                "itemsize": size,
            }
        )

    def fits(self, data: bytes) -> bool:
        """Whether `data` is a message of this layout: right size, little-endian, every string empty."""
        return (
            len(data) == self.size
            and data.startswith(ENCAPSULATION)
            and all(data.startswith(_EMPTY_STRING, at) for at in self._strings)
        )

    def read(self, data: bytes, entries: Array) -> tuple[Array, Array]:
        """`fits` of each of N messages, of shape (N,), and `stack` of those that fit.

        The bytes of each are data[begin:end] of its entry (mcap_file.ENTRY).
        """
        fits = entries["end"] - entries["begin"] == self.size
        rows = gathered(data, entries["begin"][fits], self.size)
        octets = rows.view(np.uint8).reshape(len(rows), self.size)
        good = np.ones(len(rows), bool)
        for at, constant in ((0, ENCAPSULATION), *((at, _EMPTY_STRING) for at in self._strings)):
            wanted = np.frombuffer(constant, np.uint8)
            good &= (octets[:, at : at + len(constant)] == wanted).all(axis=1)
        fits[fits] = good
        return fits, (rows if good.all() else rows[good]).view(self.dtype)

    def stack(self, messages: Sequence[bytes]) -> Array:
        """Structured array of messages that fit, one row each; columns are named by field path."""
        return np.frombuffer(b"".join(messages), dtype=self.dtype)


def gathered(data: bytes, begins: Array, size: int) -> Array:
    """data[begin : begin + size] for each of N `begins`, all within `data`: void, of shape (N,)."""
    windows = np.ndarray(max(0, len(data) - size + 1), f"V{size}", data, strides=(1,))
    rows: Array = windows[begins]
    return rows


def fixed_layout(fielddefs: Any, name: str) -> Layout | None:
    """The layout of message type `name`. `fielddefs` is a rosbags typestore's.

    None if the size differs between messages, or if it has more than _MAX_MEMBERS members.
    """
    spelled = _Spelled(fielddefs)
    try:
        end = spelled.message(name, "", _HEAD)
    except _VariableLayout:
        return None
    return Layout(spelled.leaves, spelled.strings, end)


def _aligned(offset: int, size: int) -> int:
    return offset + (_HEAD - offset) % size


class _Spelled:
    """A message definition flattened: every nested message, and every element of an array of messages."""

    def __init__(self, fielddefs: Any):
        self.leaves: list[Leaf] = []
        self.strings: list[int] = []
        self._fielddefs = fielddefs
        self._count = 0

    def message(self, name: str, prefix: str, at: int) -> int:
        """Adds the members of message `name` at offset `at`. Returns the offset after them."""
        for field, (kind, detail) in self._fielddefs[name][1]:
            at = self._member(prefix + field, kind, detail, at)
        return at

    def _member(self, path: str, kind: Any, detail: Any, at: int) -> int:
        self._count += 1
        if self._count > _MAX_MEMBERS:
            raise _VariableLayout
        if kind == Nodetype.NAME:
            return self.message(detail, path + ".", at)
        if kind == Nodetype.BASE and detail[0] == "string":
            at = _aligned(at, 4)
            self.strings.append(at)
            return at + len(_EMPTY_STRING)
        if kind == Nodetype.BASE and detail[0] in DTYPES:
            return self._numbers(path, detail[0], 0, at)
        if kind == Nodetype.ARRAY and detail[0][0] == Nodetype.BASE and detail[0][1][0] in DTYPES:
            return self._numbers(path, detail[0][1][0], detail[1], at)
        if kind == Nodetype.ARRAY and detail[0][0] == Nodetype.NAME:
            for i in range(detail[1]):
                at = self._member(f"{path}[{i}]", Nodetype.NAME, detail[0][1], at)
            return at
        raise _VariableLayout

    def _numbers(self, path: str, ros_type: str, count: int, at: int) -> int:
        size = np.dtype(DTYPES[ros_type]).itemsize
        at = _aligned(at, size)
        self.leaves.append(Leaf(path, ros_type, count, at))
        return at + size * max(1, count)


def bits(column: Array) -> Array:
    """`column`, contiguous, with all NaNs replaced by the canonical one, so that equal bytes mean equal values."""
    column = np.ascontiguousarray(column)
    if column.dtype.kind == "f" and (nan := np.isnan(column)).any():
        column = column.copy()
        column[nan] = np.nan
    return column
