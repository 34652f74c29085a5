# SPDX-License-Identifier: Apache-2.0
"""The devices and sensors of a plan as they run: ticks, and snapshots of what they told."""

from __future__ import annotations

import math
import re
import time
from collections import deque
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from fcsl_compiler.api.board import KINDS

from ..board.frontends import Frontends
from ..board.native import why_text
from ..board.plan import Plan, Sensor
from .sensor_devices import SensorDevices

_NS_PER_S = 1e9
#: Rates are measured over so long.
_RATE_NS = 2_000_000_000
_NEWS = re.compile(r"device '([^']*)' (.*)", re.DOTALL)
Values = dict[str, list[float]]


@dataclass(frozen=True)
class QuantityRange:
    """A quantity of a kind of sensor, and where it lies in the values of a reading and of what comes out."""

    name: str
    unit: str
    start: int
    end: int
    measured: bool


def quantity_ranges(kind: str) -> list[QuantityRange]:
    ends = accumulate(quantity.count for quantity in KINDS[kind])
    return [
        QuantityRange(q.name, q.unit or "", end - q.count, end, q.measured)
        for q, end in zip(KINDS[kind], ends, strict=True)
    ]


class Watch:
    """Raises TwinError for a plan that cannot be used, Refused for a device that cannot be opened."""

    def __init__(self, path: str, plan: Plan):
        self.plan, self._names = plan, list(plan.devices)
        self._frontends = Frontends(path)
        try:
            inputs = [(self._names.index(i.device), i.signal) for i in plan.inputs.values()]
            self._devices = SensorDevices(self._frontends, inputs)
        except ValueError:
            self._frontends.close()
            raise
        self._raw: dict[tuple[int, int], list[float]] = {}
        self._last_ns = dict.fromkeys(self._names, 0)
        begun = (time.monotonic_ns(), 0)
        self._history = {name: deque([begun]) for name in self._names}
        self._notes = dict.fromkeys(self._names, "")

    def tick(self, now_ns: int) -> list[str]:
        """Takes what has come and lets the frontends judge it. Returns what has changed of the devices, for people."""
        for sensor, backend, sample_ns, values in self._devices.take():
            self._frontends.take(sensor, backend, sample_ns, values)
            self._raw[sensor, backend] = values
            self._last_ns[self.plan.sensors[sensor].backends[backend].device] = sample_ns
        for one, given in zip(self.plan.inputs.values(), self._devices.inputs(), strict=True):
            if given is not None:
                self._last_ns[one.device] = given[0]
        self._frontends.tick(now_ns)
        news = self._devices.news()
        for text in news:
            if matched := _NEWS.fullmatch(text):
                self._notes[matched[1]] = "" if matched[2] == "is there" else matched[2]
        return news

    def corrected(self, sensor: int) -> Values | None:
        """What the devices measure, and what the machine would get of the rest; None where no device is healthy."""
        output = self._frontends.output(sensor)
        if output.primary < 0:
            return None
        return _by_quantity(self.plan.sensors[sensor], list(output.values))

    def snapshot(self, now_ns: int, sensors: list[int], with_hardware: bool) -> dict[str, Any]:
        """Of these sensors and what hw_read_gpio and hw_read_adc read, and of their devices."""
        inputs = self.plan.inputs if with_hardware else {}
        used = {b.device for s in sensors for b in self.plan.sensors[s].backends} | {i.device for i in inputs.values()}
        devices = [self._device(d, name, now_ns) for d, name in enumerate(self._names) if name in used]
        hardware = [
            {"name": name, "device": one.device, "signal": one.signal, "value": given[1] if given else None}
            for (name, one), given in zip(inputs.items(), self._devices.inputs() if inputs else (), strict=True)
        ]
        return {"devices": devices, "sensors": [self._sensor(s) for s in sensors], "hardware": hardware}

    def _device(self, number: int, name: str, now_ns: int) -> dict[str, Any]:
        counts, history = self._devices.counts(number), self._history[name]
        history.append((now_ns, counts.samples))
        while len(history) > 2 and now_ns - history[0][0] > _RATE_NS:
            history.popleft()
        elapsed_ns = now_ns - history[0][0]
        rate = (counts.samples - history[0][1]) / elapsed_ns * _NS_PER_S if elapsed_ns else math.nan
        last_ns = self._last_ns[name]
        return {
            "name": name,
            "driver": self.plan.devices[name].driver,
            "device": self.plan.devices[name].address,
            "there": bool(counts.open),
            "rate_hz": rate,
            "age_s": max(0, now_ns - last_ns) / _NS_PER_S if last_ns else math.nan,
            "samples": counts.samples,
            "errors": counts.errors,
            "dropped": counts.dropped,
            "lost": counts.lost,
            "bytes": counts.bytes,
            "frames": counts.frames,
            "rejected": counts.rejected,
            "why": why_text(counts.why),
            "note": self._notes[name],
        }

    def _sensor(self, number: int) -> dict[str, Any]:
        sensor = self.plan.sensors[number]
        primary, values = self._frontends.output(number).primary, self.corrected(number)
        backends = []
        for b, backend in enumerate(sensor.backends):
            raw = self._raw.get((number, b))
            backends.append(
                {
                    "device": backend.device,
                    "condition": self._frontends.condition(number, b),
                    "raw": None if raw is None else _by_quantity(sensor, raw),
                }
            )
        return {
            "name": sensor.name,
            "kind": sensor.kind,
            "primary": sensor.backends[primary].device if primary >= 0 else None,
            "values": values,
            "backends": backends,
        }

    def close(self) -> None:
        self._devices.close()
        self._frontends.close()


def _by_quantity(sensor: Sensor, values: list[float]) -> Values:
    """Without what is not told; without what the frontend computes, if no channel gets it."""
    found = {}
    for quantity in quantity_ranges(sensor.kind):
        given = values[quantity.start : quantity.end]
        while given and math.isnan(given[-1]):
            given.pop()
        if given and (quantity.measured or quantity.name in sensor.channels):
            found[quantity.name] = given
    return found
