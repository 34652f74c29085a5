# SPDX-License-Identifier: Apache-2.0
"""The sensor devices of a plan, which the native library reads by threads of their own, as in flight."""

from __future__ import annotations

from ctypes import byref

from ..board.frontends import Frontends
from ..board.native import CCounts, CSensorReading, board_library
from ..c_run import CError
from ..errors import TwinError
from .errors import Refused

_CAPACITY = 512


class SensorDevices:
    """Opens all devices of the plan of `frontends`. One that is missing is looked for again and again.

    Raises TwinError for a plan that does not fit its drivers, Refused for a device that is there and cannot be opened.
    """

    def __init__(self, frontends: Frontends):
        self._library, error = board_library(), CError()
        self._readings = (CSensorReading * _CAPACITY)()
        self._handle = self._library.board_devices_new(self._library.board_plan(frontends.handle), byref(error))
        if not self._handle:
            raise TwinError(error.text.decode(errors="replace"))
        if self._library.board_devices_start(self._handle, 0, byref(error)) != 0:
            self.close()
            raise Refused(error.text.decode(errors="replace"))

    def take(self) -> list[tuple[int, int, int, list[float]]]:
        """What has come since the last call, in its order: sensor, backend, time in ns, values."""
        found = []
        # A call gives one sample of a device that paces flights.
        while count := self._library.board_devices_take(self._handle, self._readings, _CAPACITY):
            for taken in self._readings[:count]:
                reading = taken.reading
                found.append((taken.sensor, reading.backend, reading.sample_ns, list(reading.values)))
        return found

    def counts(self, device: int) -> CCounts:
        """Of a device of the plan."""
        counts: CCounts = self._library.board_devices_counts(self._handle, device)
        return counts

    def news(self) -> list[str]:
        """What has changed of the devices since the last call, as texts for people."""
        found = []
        while (text := self._library.board_devices_news(self._handle)) is not None:
            found.append(text.decode(errors="replace"))
        return found

    def close(self) -> None:
        if self._handle:
            self._library.board_devices_free(self._handle)
            self._handle = None
