# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages under the keys of channels (docs/reference/transports.md), as the values that they carry, and back.

The compiler makes the plans of these messages as it does for the machine. What executes them is loaded with the first
message: a machine whose values lie on the bus as they are needs none of it.
"""

from __future__ import annotations

import ctypes
import struct
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ..errors import BusError, MapError

if TYPE_CHECKING:
    from ..ros.composer import Composer
    from ..ros.reader import Reader

#: Encapsulation, empty layout, and the number of bytes of a blob.
_BLOB = struct.Struct("<4sIII")
_ENCAPSULATION = b"\0\1\0\0"
_PADDING = 7  # bytes by which DDS may align the end of a message


@dataclass(frozen=True)
class Payload:
    """The message of a channel: `ros_type`, and the part that is the channel's: `count` values of `type`."""

    name: str
    ros_type: str
    field: str
    frame: str
    child_frame: str
    axes: str
    type: str
    count: int
    is_blob: bool

    def read(self, message: bytes) -> bytes | None:
        """The values, little-endian; None if the message is none of the channel."""
        return _read_blob(message) if self.is_blob else self._reader.read(message, _PADDING)

    def write(self, values: bytes) -> bytes:
        """The message of these values, with stamp 0. Raises BusError where it cannot hold them."""
        if self.is_blob:
            return _BLOB.pack(_ENCAPSULATION, 0, 0, len(values)) + values
        memory = ctypes.create_string_buffer(values, max(1, len(values)))
        message = self._composer.compose([ctypes.addressof(memory)], 0)
        if message is None:
            raise BusError(f"`{self.name}` travels as {self.ros_type}, whose `{self.field}` cannot hold this value")
        return message

    @cached_property
    def _reader(self) -> Reader:
        from fcsl_compiler.api.ros import STANDARD, Pick, full_name

        from ..ros.reader import Reader

        pick = Pick(self.name, (self.field,), self.type, self.count, axes=self.axes)
        message, frames = full_name(self.ros_type), (self.frame, self.child_frame)
        try:
            return Reader(STANDARD, message, [pick], *frames, nan_allowed=True)
        except MapError as error:  # a descriptor of somebody else's
            raise BusError(str(error)) from None

    @cached_property
    def _composer(self) -> Composer:
        from fcsl_compiler.api.ros import STANDARD, Source, full_name

        from ..ros.composer import Composer

        source = Source(self.field, self.type, self.count, 0, axes=self.axes, name=self.name)
        try:
            return Composer(STANDARD, full_name(self.ros_type), [source], self.frame, self.child_frame)
        except MapError as error:
            raise BusError(str(error)) from None


def _read_blob(message: bytes) -> bytes | None:
    if len(message) < _BLOB.size:
        return None
    encapsulation, dimensions, offset, count = _BLOB.unpack_from(message)
    behind = len(message) - _BLOB.size - count
    fits = encapsulation[:2] == _ENCAPSULATION[:2] and dimensions == offset == 0 and 0 <= behind <= _PADDING
    return message[_BLOB.size : _BLOB.size + count] if fits else None
