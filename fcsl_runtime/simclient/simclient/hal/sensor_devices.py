# SPDX-License-Identifier: Apache-2.0
"""The devices of a plan that are read: the native library does it, by threads of their own, as in flight."""

from __future__ import annotations

from collections.abc import Iterable
from ctypes import byref

from ..board.frontends import Frontends
from ..board.native import CCounts, CSensorReading, board_library
from ..c_run import CError
from ..errors import TwinError
from .errors import Refused

_CAPACITY = 512


class SensorDevices:
    """Opens the devices of sensors of the plan of `frontends`, and those of `inputs`: device of the plan and its signal. One that is
    missing is looked for again and again.

    Raises TwinError for a plan that does not fit its drivers, Refused for a device that is there and cannot be opened.
    """

    def __init__(self, frontends: Frontends, inputs: Iterable[tuple[int, str]]):
        self._library, error = board_library(), CError()
        self._readings = (CSensorReading * _CAPACITY)()
        self._handle = self._library.board_devices_new(self._library.board_plan(frontends.handle), byref(error))
        if not self._handle:
            raise TwinError(error.text.decode(errors="replace"))
        self._places = [(device, self._use(device, signal)) for device, signal in inputs]
        if self._library.board_devices_start(self._handle, 0, byref(error)) != 0:
            self.close()
            raise Refused(error.text.decode(errors="replace"))

    def _use(self, device: int, signal: str) -> int:
        """Where the signal lies in the samples of the device."""
        error = CError()
        place: int = self._library.board_devices_use(self._handle, device, signal.encode(), byref(error))
        if place < 0:
            self.close()
            raise TwinError(error.text.decode(errors="replace"))
        return place

    def inputs(self) -> list[tuple[int, float] | None]:
        """Of each input its time in ns and its value, as of the last `take`; None where its device has none."""
        samples = [(self._library.board_devices_latest(self._handle, device), at) for device, at in self._places]
        return [(sample[0].sample_ns, sample[0].values[at]) if sample else None for sample, at in samples]

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
