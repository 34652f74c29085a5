# SPDX-License-Identifier: Apache-2.0
"""Reads samples from ROS 2 messages, by a conversion (fcsl_compiler.ros.reader)."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcsl_compiler.api.ros import ConversionError, Definitions, Pick, has_stamp, reader_conversion

from ..c_run import CError
from ..errors import MapError, TwinError
from . import native

#: Names of fcsl_ros_status_t.
REASONS = native.REASONS

_DTYPES = {"bool": "?", "i32": "<i4", "u32": "<u4", "i64": "<i8", "u64": "<u8", "f32": "<f4", "f64": "<f8"}
_DTYPES |= dict.fromkeys(("TransitionRequest", "Health", "state"), "<i4")


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
        self,
        definitions: Definitions,
        message: str,
        picks: Sequence[Pick],
        frame: str = "",
        child_frame: str = "",
        *,
        nan_allowed: bool = False,
    ):
        """`message`: full name of the type. `frame`, `child_frame`: required header.frame_id and child_frame_id (empty:
        any). `nan_allowed`: a NaN is a value, else it is refused.

        Raises MapError, which names the pick that does not fit the message and why.
        """
        try:
            conversion = replace(
                reader_conversion(definitions, message, picks, frame, child_frame), nan_allowed=nan_allowed
            )
        except ConversionError as error:
            raise MapError(str(error)) from None
        self.has_stamp = has_stamp(definitions, message)
        self._open(native.reader_conversion(conversion), [(p.name, p.type, p.count) for p in picks])

    @classmethod
    def compiled(cls, address: int, columns: Sequence[tuple[str, str, int]]) -> Reader:
        """By the conversion at an address in a machine's library, which stays loaded. `columns`: name, type and count of
        each value."""
        made, conversion = cls.__new__(cls), native.CReaderConversion.from_address(address)
        made.has_stamp = conversion.stamp_anchor != native.NONE
        made._open(conversion, columns)
        return made

    def _open(self, conversion: native.CReaderConversion, columns: Sequence[tuple[str, str, int]]) -> None:
        values = [conversion.values[i] for i in range(conversion.value_count)]
        self.dtype = _dtype(columns, [value.offset for value in values], conversion.size)
        #: Of each pick, whether it is a rotation, of which a quaternion of length zero is refused.
        self.rotations = tuple(bool(value.rotation) for value in values)
        self._conversion = conversion  # the reader keeps its address
        library, failure = native.library(), CError()
        handle = library.fcsl_ros_reader_new(byref(self._conversion), byref(failure))
        if not handle:
            raise TwinError(failure.text.decode("utf-8", "replace"))
        self._handle: int = handle
        self._read, self._end = library.fcsl_ros_read, library.fcsl_ros_reader_end
        self._read_many = library.fcsl_ros_read_many
        self._value_count = len(columns)
        self._row = ctypes.create_string_buffer(max(1, conversion.size))
        self._status = ctypes.create_string_buffer(max(1, len(columns)))
        self._stamp = ctypes.c_int64()
        weakref.finalize(self, library.fcsl_ros_reader_free, handle)

    @property
    def handle(self) -> int:
        """The address of the fcsl_ros_reader_t, which is valid as long as this object."""
        return self._handle

    def read(self, message: bytes, padding: int) -> bytes | None:
        """The bytes of the values of one message, as `dtype` says; None if it is none, has a value that is refused, or
        more than `padding` bytes behind what its type takes."""
        status = self._read(self._handle, message, len(message), self._row, self._status, ctypes.byref(self._stamp))
        if status != 0 or any(self._status.raw) or len(message) - self._end(self._handle) > padding:
            return None
        return self._row.raw[: self.dtype.itemsize]

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


def _dtype(columns: Sequence[tuple[str, str, int]], offsets: Sequence[int], size: int) -> np.dtype[Any]:
    return np.dtype(
        {
            "names": [name for name, _, _ in columns],
            "formats": [(_DTYPES[type_], (count,) if count > 1 else ()) for _, type_, count in columns],
            "offsets": list(offsets),
            "itemsize": size,
        }
    )
