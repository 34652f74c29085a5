# SPDX-License-Identifier: Apache-2.0
"""Composes ROS 2 messages from memory, by a conversion (fcsl_compiler.ros.composer)."""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Sequence
from ctypes import byref

from fcsl_compiler.api.ros import ConversionError, Definitions, Source, composer_conversion

from ..c_run import CError
from ..errors import MapError, TwinError
from . import native


class Composer:
    """Composes messages of one type."""

    def __init__(
        self,
        definitions: Definitions,
        message: str,
        sources: Sequence[Source],
        frame: str = "",
        child_frame: str = "",
        stamped: str = "",
    ):
        """`message`, `stamped`: as composer_conversion takes them. Raises MapError, which names the source that does not fit and
        why."""
        try:
            conversion = composer_conversion(definitions, message, sources, frame, child_frame, stamped)
        except ConversionError as error:
            raise MapError(str(error)) from None
        self._open(native.composer_conversion(conversion))

    @classmethod
    def compiled(cls, address: int) -> Composer:
        """By the conversion at an address in a machine's library, which stays loaded."""
        made = cls.__new__(cls)
        made._open(native.CComposerConversion.from_address(address))
        return made

    def _open(self, conversion: native.CComposerConversion) -> None:
        self._memories = (ctypes.c_void_p * conversion.memory_count)()
        self._conversion = conversion  # the composer keeps its address
        library, failure = native.library(), CError()
        handle = library.fcsl_ros_composer_new(byref(self._conversion), byref(failure))
        if not handle:
            raise TwinError(failure.text.decode("utf-8", "replace"))
        self._handle, self._compose = handle, library.fcsl_ros_compose
        self._message = ctypes.create_string_buffer(conversion.size)
        self._size = ctypes.c_uint32()
        #: Messages that were not composed, because a value does not fit its field.
        self.refused = 0
        weakref.finalize(self, library.fcsl_ros_composer_free, handle)

    @property
    def handle(self) -> int:
        """The fcsl_ros_composer_t; it lives as long as this object."""
        return int(self._handle)

    @property
    def size(self) -> int:
        """Bytes of the longest message."""
        return len(self._message)

    def compose(self, memories: Sequence[int], time_ns: int) -> bytes | None:
        """The message (CDR) with stamp `time_ns` (ns); None, counted in `refused`, if a value does not fit its field.

        `memories`: their addresses, which must be valid.
        """
        self._memories[:] = list(memories)
        if self._compose(self._handle, self._memories, time_ns, self._message, byref(self._size)) != 0:
            self.refused += 1
            return None
        return self._message.raw[: self._size.value]
