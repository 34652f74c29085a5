# SPDX-License-Identifier: Apache-2.0
"""Where the fields of a ROS 2 message lie in its CDR bytes, when every message of the type has the same layout.

The messages of a machine do: scalars, fixed arrays and a header whose frame_id is empty. Knowing the layout, thousands
of messages become numpy columns at once. Types with sequences or filled strings are decoded one by one instead
(simclient.bag).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

#: CDR representation header in front of every message; alignment counts from behind it.
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


@dataclass(frozen=True)
class Leaf:
    """A scalar (count 0) or a fixed array of `count` scalars, `offset` bytes into the message."""

    path: str
    ros_type: str
    count: int
    offset: int

    @property
    def dtype(self) -> np.dtype[Any]:
        return np.dtype((DTYPES[self.ros_type], (self.count,)) if self.count else DTYPES[self.ros_type])


class _VariableLayout(Exception):
    """The type holds something whose size differs between messages."""


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
        """Whether `data` is a message of this layout: its size, little-endian, every string empty."""
        return (
            len(data) == self.size
            and data.startswith(ENCAPSULATION)
            and all(data.startswith(_EMPTY_STRING, at) for at in self._strings)
        )

    def stack(self, messages: Sequence[bytes]) -> np.ndarray[Any, Any]:
        """Structured array of messages that fit, one row each; its columns are named by field path."""
        return np.frombuffer(b"".join(messages), dtype=self.dtype)


def fixed_layout(fielddefs: Any, name: str) -> Layout | None:
    """The layout of message type `name`, or None when its messages differ. `fielddefs` is a rosbags typestore's."""
    leaves: list[Leaf] = []
    strings: list[int] = []
    try:
        end = _walk(fielddefs, name, "", _HEAD, leaves, strings)
    except _VariableLayout:
        return None
    return Layout(leaves, strings, end)


def _aligned(offset: int, size: int) -> int:
    return offset + (_HEAD - offset) % size


def _walk(fielddefs: Any, name: str, prefix: str, at: int, leaves: list[Leaf], strings: list[int]) -> int:
    for field, (kind, detail) in fielddefs[name][1]:
        at = _member(fielddefs, prefix + field, kind, detail, at, leaves, strings)
    return at


def _member(fielddefs: Any, path: str, kind: Any, detail: Any, at: int, leaves: list[Leaf], strings: list[int]) -> int:
    if kind == Nodetype.NAME:
        return _walk(fielddefs, detail, path + ".", at, leaves, strings)
    if kind == Nodetype.BASE and detail[0] == "string":
        at = _aligned(at, 4)
        strings.append(at)
        return at + len(_EMPTY_STRING)
    if kind == Nodetype.BASE and detail[0] in DTYPES:
        return _numbers(path, detail[0], 0, at, leaves)
    if kind == Nodetype.ARRAY and detail[0][0] == Nodetype.BASE and detail[0][1][0] in DTYPES:
        return _numbers(path, detail[0][1][0], detail[1], at, leaves)
    if kind == Nodetype.ARRAY and detail[0][0] == Nodetype.NAME:
        for i in range(detail[1]):
            at = _walk(fielddefs, detail[0][1], f"{path}[{i}].", at, leaves, strings)
        return at
    raise _VariableLayout


def _numbers(path: str, ros_type: str, count: int, at: int, leaves: list[Leaf]) -> int:
    size = np.dtype(DTYPES[ros_type]).itemsize
    at = _aligned(at, size)
    leaves.append(Leaf(path, ros_type, count, at))
    return at + size * max(1, count)


def bits(column: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """A copy of `column` whose NaNs are all the canonical one, so that equal bytes mean equal values."""
    column = np.ascontiguousarray(column)
    if column.dtype.kind == "f":
        column = column.copy()
        column[np.isnan(column)] = np.nan
    return column
