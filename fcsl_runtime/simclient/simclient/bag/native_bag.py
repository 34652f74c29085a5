# SPDX-License-Identifier: Apache-2.0
"""Python wrapper of fcsl_bag.h: the bag on disk that the hosts' recorders write, which outlives a killed process."""

from __future__ import annotations

import functools
import os
import time
from ctypes import POINTER, byref, c_char_p, c_int, c_uint32, c_uint64, c_void_p
from pathlib import Path
from types import TracebackType
from typing import Any

from ..c_run import CError
from ..errors import BagError
from ..library import bind_runtime, runtime_library

#: What is written is handed to the operating system this often, as the hosts' recorders do.
_FLUSH_S = 1.0
_ERROR = POINTER(CError)


class NativeBag:
    """A new bag. First its topics are added, then it is published under its name, then messages are written. A context
    manager, which completes it. Raises BagError, which names the bag; what was written before stays readable.
    """

    def __init__(self, path: Path):
        self._error = CError()
        self._library = _library()
        self._handle = self._library.fcsl_bag_open(os.fsencode(path), 0, byref(self._error))
        self._is_published = self._has_failed = False
        self._flushed_s = time.monotonic()
        if not self._handle:
            raise self._failure()

    def _failure(self) -> BagError:
        self._has_failed = True
        return BagError(self._error.text.decode("utf-8", "replace"))

    def _check(self, status: int) -> int:
        if status < 0:
            raise self._failure()
        return status

    def add(self, topic: str, kind: str, definition: str) -> int:
        """The number of a topic of ROS 2 messages (cdr); `definition` is complete."""
        names = (text.encode() for text in (topic, kind, definition))
        return self._check(self._library.fcsl_bag_add_topic(self._handle, *names, 0, byref(self._error)))

    def publish(self) -> None:
        self._check(self._library.fcsl_bag_publish(self._handle, byref(self._error)))
        self._is_published = True

    def write(self, topic: int, time_ns: int, message: bytes) -> None:
        size = len(message)
        self._check(self._library.fcsl_bag_write(self._handle, topic, time_ns, message, size, byref(self._error)))

    def flush_when_due(self) -> None:
        """Call it behind each write, and about once a second where none comes."""
        if time.monotonic() < self._flushed_s + _FLUSH_S:
            return
        self._flushed_s = time.monotonic()
        self._check(self._library.fcsl_bag_flush(self._handle, byref(self._error)))
        # Should this fail, the file is as good as before; closing writes it once more, and says if that fails.
        self._library.fcsl_bag_write_metadata(self._handle, None)

    def __enter__(self) -> NativeBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        handle, self._handle = self._handle, None
        if not self._is_published:
            self._library.fcsl_bag_abandon(handle)
        elif self._has_failed:  # that was told
            self._library.fcsl_bag_close(handle, None)
        else:
            self._check(self._library.fcsl_bag_close(handle, byref(self._error)))


@functools.cache
def _library() -> Any:
    bag = c_void_p
    return bind_runtime(
        runtime_library(),
        {
            "fcsl_bag_open": (bag, [c_char_p, c_uint64, _ERROR]),
            "fcsl_bag_publish": (c_int, [bag, _ERROR]),
            "fcsl_bag_add_topic": (c_int, [bag, c_char_p, c_char_p, c_char_p, c_int, _ERROR]),
            "fcsl_bag_write_metadata": (c_int, [bag, _ERROR]),
            "fcsl_bag_write": (c_int, [bag, c_uint32, c_uint64, c_char_p, c_uint32, _ERROR]),
            "fcsl_bag_flush": (c_int, [bag, _ERROR]),
            "fcsl_bag_close": (c_int, [bag, _ERROR]),
            "fcsl_bag_abandon": (None, [bag]),
        },
    )
