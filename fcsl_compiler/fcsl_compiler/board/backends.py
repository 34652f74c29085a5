# SPDX-License-Identifier: Apache-2.0
"""The backends of a sensor: the devices that measure the same, in order of preference."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .corrections import Correction, read_corrections
from .devices import Device, read_device_name
from .drivers import ACTUATOR, check_signal, kind_of, read_signal
from .filters import Filter, Section, sections_for
from .kinds import KINDS, MAX_BACKENDS
from .quantities import by_quantity, measured
from .rotations import IDENTITY, Matrix, read_rotation
from .sticks import Stick, read_sticks


@dataclass(frozen=True)
class Backend:
    """`signals`: names that the device's driver has for quantities. `sections` with their quantities, in order."""

    device: Device
    signals: dict[str, str]
    corrections: dict[str, Correction]
    sticks: tuple[Stick, ...]
    sections: tuple[tuple[str, Section], ...]


@dataclass(frozen=True)
class BackendReader:
    """Reads the backends of the sensors of one board. `used` collects the names of their devices."""

    devices: dict[str, Device | None]
    reader: ConfigReader
    used: set[str]

    def read(self, node: JsonNode | None, kind: str, filters: tuple[Filter, ...]) -> tuple[Backend, ...]:
        items = self.reader.list(node, "`backends`")
        if node is not None and node.kind == "array" and not 1 <= len(items) <= MAX_BACKENDS:
            fix = f"list 1 to {MAX_BACKENDS} devices, the preferred one first"
            self.reader.sink.error("E509", f"a sensor with {len(items)} backends", node.span, help=fix)
        places: dict[str, Span] = {}
        backends = [self._backend(item, kind, filters, places) for item in items]
        return tuple(b for b in backends if b is not None)

    def _backend(
        self, node: JsonNode, kind: str, filters: tuple[Filter, ...], places: dict[str, Span]
    ) -> Backend | None:
        keys = self.reader.object(node, "a backend", ("device",), ("rotation", "correct", "signals", "sticks"))
        if keys is None:
            return None
        device = self._device(keys.get("device"), places)
        rotation = self._rotation(keys.get("rotation"), kind)
        corrections = read_corrections(keys.get("correct"), rotation, kind, self.reader)
        signals = self._signals(keys.get("signals"), kind, device)
        sticks = read_sticks(keys.get("sticks"), kind, self.reader)
        if device is None:
            return None
        return Backend(device, signals, corrections, sticks, sections_for(filters, device, self.reader))

    def _device(self, node: JsonNode | None, places: dict[str, Span]) -> Device | None:
        """The device that a backend names. `places`: where this sensor names its devices."""
        name = read_device_name(node, self.devices, self.used, self.reader)
        if node is None or name is None:
            return None
        first = places.setdefault(name, node.span)
        if first is not node.span:
            message, notes = f"device `{name}` twice in one sensor", [(first, "the first time")]
            self.reader.sink.error("E509", message, node.span, help="remove this", notes=notes)
        device = self.devices[name]
        if device is not None and kind_of(device.driver) == ACTUATOR:
            message, why = f"device `{name}` cannot be a backend", f"`{device.driver}` drives actuators"
            self.reader.sink.error("E518", message, node.span, why=why, notes=[(device.span, "the device")])
        return device

    def _rotation(self, node: JsonNode | None, kind: str) -> Matrix:
        if node is not None and not any(q.in_axes for q in KINDS[kind]):
            message = f"a rotation of a sensor of kind `{kind}`"
            why = "it measures nothing along the axes of the device"
            self.reader.sink.error("E510", message, node.span, why=why, help="remove it")
            return IDENTITY
        return read_rotation(node, self.reader) or IDENTITY

    def _signals(self, node: JsonNode | None, kind: str, device: Device | None) -> dict[str, str]:
        found: dict[str, str] = {}
        for quantity, value in by_quantity(node, "`signals`", measured(kind), self.reader):
            name = read_signal(value, f"the signal of `{quantity.name}`", self.reader)
            if name is not None:
                found[quantity.name] = name
                if device is not None:
                    check_signal(name, device.driver, value.span, self.reader)
        return found
