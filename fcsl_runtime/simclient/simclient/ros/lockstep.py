# SPDX-License-Identifier: Apache-2.0
"""Python wrapper of fcsl_lockstep.h: a run in lock-step with a simulator on the bus, some ticks at a time."""

from __future__ import annotations

import ctypes
import functools
from ctypes import POINTER, byref, c_char_p, c_int, c_uint32, c_uint64
from ctypes import c_void_p as ptr
from pathlib import Path

from ..c_run import CError
from ..errors import TwinError
from ..library import bind_runtime, runtime_library
from ..run import Run
from .publish_queue import PublishQueue, RunTopics

_ERROR = POINTER(CError)
_PROTOTYPES: dict[str, tuple[type | None, list[type]]] = {
    "fcsl_lockstep_new": (ptr, [ptr, ptr, ptr, c_char_p, c_char_p, _ERROR]),
    "fcsl_lockstep_free": (None, [ptr]),
    "fcsl_lockstep_connect": (c_int, [ptr, c_uint32, c_uint32, _ERROR]),
    "fcsl_lockstep_run": (c_int, [ptr, c_uint32, _ERROR]),
    "fcsl_lockstep_drop": (c_int, [ptr, c_uint32, c_uint32, _ERROR]),
    "fcsl_lockstep_drop_none": (None, [ptr]),
    "fcsl_lockstep_keep_alive": (None, [ptr]),
    "fcsl_lockstep_leave": (None, [ptr]),
    "fcsl_lockstep_count": (c_uint64, [ptr, c_char_p]),
}
_LIBRARY = "libfcsl_lockstep.so"
#: fcsl_lockstep_status_t by number.
_STATUS_NAMES = ("running", "ended", "again", "gone")


@functools.cache
def _load(path: Path) -> ctypes.CDLL:
    return bind_runtime(path, _PROTOTYPES)


class Lockstep:
    """`address`: zenoh:tcp:HOST:PORT or wire:unix:PATH, where a simulator listens; name_space: in front of the keys on
    the bus. Raises TwinError."""

    def __init__(self, run: Run, topics: RunTopics, queue: PublishQueue, address: str, name_space: str = ""):
        self._library, self._error = _load(runtime_library().with_name(_LIBRARY)), CError()
        self._kept = (run, topics, queue)
        within = name_space.strip("/").encode()
        parts = (run.handle(), topics.handle, queue.handle)
        self._handle = self._library.fcsl_lockstep_new(*parts, address.encode(), within, byref(self._error))
        if not self._handle:
            raise TwinError(self.problem)

    @property
    def problem(self) -> str:
        """Why the last call failed, or found nobody."""
        return bytes(self._error.text).decode("utf-8", "replace")

    def _check(self, status: int) -> int:
        if status < 0:
            raise TwinError(self.problem)
        return status

    def connect(self, wait_ms: int, timeout_ms: int) -> bool:
        """Looks for a simulator for up to `wait_ms`; whether there is one. `timeout_ms`: how long a tick may take it."""
        status = self._library.fcsl_lockstep_connect(self._handle, wait_ms, timeout_ms, byref(self._error))
        return self._check(status) == 0

    def run(self, slice_ms: int) -> str:
        """Makes the ticks of about `slice_ms`. Returns `running`, `ended`, `again` (the simulator begins another run), or
        `gone` (it does not live any more; `problem` says at which tick)."""
        return _STATUS_NAMES[self._check(self._library.fcsl_lockstep_run(self._handle, slice_ms, byref(self._error)))]

    def drop(self, channel: int, ticks: int) -> None:
        """Sensor channel number `channel` gets no sample in the next `ticks` ticks."""
        self._check(self._library.fcsl_lockstep_drop(self._handle, channel, ticks, byref(self._error)))

    def drop_none(self) -> None:
        """Ends all dropouts."""
        self._library.fcsl_lockstep_drop_none(self._handle)

    def keep_alive(self) -> None:
        """While no ticks are run, called often: the simulator waits on."""
        self._library.fcsl_lockstep_keep_alive(self._handle)

    def leave(self) -> None:
        """Tells the simulator that no tick is answered any more."""
        self._library.fcsl_lockstep_leave(self._handle)

    def count(self, path: str) -> int:
        """What the HAL counts under `path` (docs/hardware/hal.md); 0 while no simulator is connected."""
        return int(self._library.fcsl_lockstep_count(self._handle, path.encode()))

    def close(self) -> None:
        """Leaves and frees it; before its run. Idempotent."""
        if self._handle:
            self._library.fcsl_lockstep_free(self._handle)
            self._handle = None
