# SPDX-License-Identifier: Apache-2.0
"""The sensors of a board: readings of devices in, samples of the machine's channels out."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable
from ctypes import byref
from pathlib import Path

import numpy as np

from ..c_run import CError
from ..errors import TwinError
from ..run import Run
from .native import VALUES, COutput, CReading, board_library

#: Of fcsl_backend_condition_t.
CONDITIONS = ("healthy", "silent", "invalid", "out of range", "stuck", "disagrees", "recovering")


class Frontends:
    """The frontends of the board whose plan is in the file `plan`. Samples go to `run`, if there is one. Raises TwinError."""

    def __init__(self, plan: str | Path, run: Run | None = None):
        self._library, self._error, self._run = board_library(), CError(), run
        handle = run.handle() if run is not None else None
        self.handle = self._library.board_open(os.fsencode(plan), handle, byref(self._error))
        if not self.handle:
            raise TwinError(self._error.text.decode(errors="replace"))

    def take(self, sensor: int, backend: int, sample_ns: int, values: Iterable[float]) -> None:
        """A reading of a device, measured at `sample_ns`: the quantities that its kind measures, NaN for what it does not
        tell. Raises ValueError for more values than a reading has."""
        measured = np.asarray(values, dtype=np.float64)
        if measured.ndim != 1 or measured.size > VALUES:
            raise ValueError(f"a reading has {VALUES} values at most, not {measured.size}")
        given = np.full(VALUES, np.nan)
        given[: measured.size] = measured
        reading = CReading(sample_ns, backend)
        ctypes.memmove(reading.values, given.tobytes(), given.nbytes)
        self._library.board_take(self.handle, sensor, byref(reading))

    def tick(self, now_ns: int) -> None:
        """Judges all devices at `now_ns`, and gives the channels of the coming tick what is new. Raises TwinError."""
        if self._library.board_tick(self.handle, now_ns, byref(self._error)) != 0:
            raise TwinError(self._error.text.decode(errors="replace"))

    def output(self, sensor: int) -> COutput:
        """What the sensor gave in the last tick; it changes with the next one."""
        found: COutput = self._library.board_output(self.handle, sensor).contents
        return found

    def condition(self, sensor: int, backend: int) -> str:
        return CONDITIONS[self._library.board_condition(self.handle, sensor, backend)]

    def close(self) -> None:
        if self.handle:
            self._library.board_close(self.handle)
            self.handle = None
