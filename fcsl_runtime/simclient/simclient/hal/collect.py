# SPDX-License-Identifier: Apache-2.0
"""Samples of a sensor's device for a calibration."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np

from fcsl_compiler.api.board import KINDS

from ..errors import TwinError
from .board_file import Target
from .driver import Device, Driver, Values
from .driver_abi import SENSOR
from .errors import Refused
from .least_squares import Vector

_SILENT_S = 2.0
_TEMPERATURE = "temperature"
_REPORT_S, _REPORT_TERMINAL_S = 2.0, 0.2


class Source:
    """The open device of a target. Raises TwinError without its driver, Refused where it cannot be opened."""

    def __init__(self, target: Target, quantity: str, optional: Sequence[str] = ()):
        self._target, self._quantity = target, quantity
        device = target.backend.device
        driver = Driver(device.driver, SENSOR)
        if not driver.waits and not device.period_s:
            raise TwinError(
                f"device `{device.name}`: driver `{device.driver}` does not wait for samples: give it a rate_hz"
            )
        self._check(driver)
        known = {signal.name for signal in driver.signals}
        wanted = [target.signal(name) for name in (_TEMPERATURE, *optional)]
        self._device: Device = driver.open(
            device.address, needed=[target.signal(quantity)], optional=[name for name in wanted if name in known]
        )
        self._period_s = 0.0 if driver.waits else device.period_s

    def _check(self, driver: Driver) -> None:
        """As a flight does when it opens the board. Raises TwinError."""
        quantity = next(q for kind in KINDS.values() for q in kind if q.name == self._quantity)
        name = self._target.signal(self._quantity)
        signal = next((s for s in driver.signals if s.name == name), None)
        where = f"device `{self._target.backend.device.name}`: driver `{driver.name}`"
        if signal is None:
            raise TwinError(f"{where} has no signal `{name}`")
        if quantity.unit and signal.unit not in ("", quantity.unit):
            raise TwinError(f"{where} gives `{name}` in {signal.unit}, here it must be in {quantity.unit}")
        if quantity.in_axes and signal.count != quantity.count:
            raise TwinError(f"{where} gives {signal.count} of `{name}`, not {quantity.count}")

    def samples(self, seconds: float) -> Iterator[tuple[float, Values]]:
        """Seconds since the start, and values by signal. Raises Refused where the device is silent for 2 s."""
        begun = last = due = time.monotonic()
        while (now := time.monotonic()) - begun < seconds:
            sample = self._device.read()
            if sample is not None:
                last = now
                yield now - begun, sample.values
            elif now - last > _SILENT_S:
                raise Refused(f"device '{self._device.address}' has been silent for {_SILENT_S:g} s")
            if self._period_s:  # else the read has waited
                now = time.monotonic()
                due = max(due + self._period_s, now)
                time.sleep(due - now)

    def vectors(self, seconds: float) -> Iterator[tuple[float, Vector]]:
        """Seconds since the start, and the quantity without what the board's correction takes off for the temperature."""
        correction = self._target.backend.corrections.get(self._quantity)
        signal, temperature_signal = self._target.signal(self._quantity), self._target.signal(_TEMPERATURE)
        for at, values in self.samples(seconds):
            vector = np.array(values[signal][:3])
            temperature = values.get(temperature_signal, [np.nan])[0]
            if correction is not None and np.isfinite(temperature):
                vector -= np.array(correction.per_kelvin) * (temperature - correction.celsius)
            if np.isfinite(vector).all():
                yield at, vector

    def close(self) -> None:
        self._device.close()

    def __enter__(self) -> Source:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Report:
    """A line about what goes on: in place on a terminal, else every two seconds."""

    def __init__(self) -> None:
        self._live = sys.stdout.isatty()
        self._next = 0.0 if self._live else _REPORT_S

    def is_due(self, seconds: float) -> bool:
        return seconds >= self._next

    def at(self, seconds: float, text: str) -> None:
        if self.is_due(seconds):
            self._next = seconds + (_REPORT_TERMINAL_S if self._live else _REPORT_S)
            print(f"\r{text}\x1b[K" if self._live else text, end="" if self._live else "\n", flush=True)

    def end(self) -> None:
        if self._live:
            print("\r\x1b[K", end="", flush=True)
