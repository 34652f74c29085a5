# SPDX-License-Identifier: Apache-2.0
"""The whole plan of a board. fcsl_runtime/board/board_plan.h defines the format, and its reader checks the file first."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from ctypes import byref
from dataclasses import dataclass, field
from pathlib import Path

from fcsl_compiler.api.board import Line

from ..c_run import CError
from ..errors import TwinError, did_you_mean
from .native import board_library


@dataclass(frozen=True)
class Device:
    """`period_ns` 0: its driver waits for samples, or drives actuators."""

    name: str
    driver: str
    address: str
    period_ns: int


@dataclass
class Correction:
    """matrix · (raw - offset - per_kelvin · (temperature - celsius)); the matrix row by row."""

    matrix: list[float]
    offset: list[float]
    per_kelvin: list[float]
    celsius: float


@dataclass
class Backend:
    """By quantity, but `sticks`: by channel [minimum, middle, maximum, deadband]. A section: [b0, b1, b2, a1, a2]."""

    device: str
    signals: dict[str, str] = field(default_factory=dict)
    corrections: dict[str, Correction] = field(default_factory=dict)
    sticks: dict[int, list[float]] = field(default_factory=dict)
    sections: dict[str, list[list[float]]] = field(default_factory=dict)


@dataclass
class Sensor:
    """`health`: max_age_ns, stuck_ns, recover_ns. The rest by quantity."""

    name: str
    kind: str
    health: tuple[int, int, int] = (0, 0, 0)
    limits: dict[str, list[float]] = field(default_factory=dict)
    tolerances: dict[str, float] = field(default_factory=dict)
    channels: dict[str, str] = field(default_factory=dict)
    backends: list[Backend] = field(default_factory=list)


@dataclass(frozen=True)
class Pulse:
    """board_pulse_t"""

    index: int
    signal: str
    low: float
    high: float
    minimum: float
    middle: float
    maximum: float
    slew: float
    safe: float

    @property
    def line(self) -> Line:
        return Line(self.low, self.high, self.minimum, self.middle, self.maximum)


@dataclass
class Output:
    channel: str
    device: str
    pulses: list[Pulse] = field(default_factory=list)


@dataclass(frozen=True)
class Pin:
    """`safe`: the level of an output before the first tick and after the last one; None: an input."""

    number: int
    device: str
    signal: str
    safe: bool | None


@dataclass(frozen=True)
class Converter:
    """An input of an analog-digital converter."""

    number: int
    device: str
    signal: str


@dataclass(frozen=True)
class Registers:
    """`bytes` of a file from `offset` on, which have the addresses from `address` on."""

    address: int
    bytes: int
    offset: int
    write: bool
    file: str


@dataclass
class Plan:
    """`pace`: the device whose samples are the ticks; "" without one. `undriven`: actuator channels without an output."""

    machine: str = ""
    tick_hz: int = 0
    pace: str = ""
    pace_timeout_ns: int = 0
    devices: dict[str, Device] = field(default_factory=dict)
    sensors: list[Sensor] = field(default_factory=list)
    outputs: list[Output] = field(default_factory=list)
    undriven: list[str] = field(default_factory=list)
    pins: list[Pin] = field(default_factory=list)
    converters: list[Converter] = field(default_factory=list)
    registers: list[Registers] = field(default_factory=list)

    @property
    def inputs(self) -> dict[str, Pin | Converter]:
        """What hw_read_gpio and hw_read_adc read of devices, by name."""
        pins = {f"gpio {pin.number}": pin for pin in self.pins if pin.safe is None}
        return {**pins, **{f"adc {converter.number}": converter for converter in self.converters}}


def read_plan(path: str | Path) -> Plan:
    """Raises TwinError, with file and line, for what is not a plan."""
    library, error = board_library(), CError()
    checked = library.board_plan_read(os.fsencode(path), byref(error))
    if not checked:
        raise TwinError(error.text.decode(errors="replace"))
    library.board_plan_free(checked)
    plan = Plan()
    try:
        with open(path, encoding="utf-8") as file:
            for line in file.read().splitlines():
                _take(plan, line.split(" "))
    except (OSError, ValueError, LookupError) as problem:
        raise TwinError(f"{path}: cannot be read: {problem}") from None
    return plan


def find_sensor(plan: Plan, name: str) -> int:
    """Its index. Raises TwinError."""
    names = [sensor.name for sensor in plan.sensors]
    if name not in names:
        raise TwinError(
            f"the plan has no sensor `{name}`{did_you_mean(name, names)}; it has {', '.join(names) or 'none'}"
        )
    return names.index(name)


def _take(plan: Plan, words: Sequence[str]) -> None:
    match words:
        case ["machine", name, tick_hz]:
            plan.machine, plan.tick_hz = name, int(tick_hz)
        case ["device", name, period_ns, driver, *address]:
            plan.devices[name] = Device(name, driver, " ".join(address), int(period_ns))
        case ["pace", device, timeout_ns]:
            plan.pace, plan.pace_timeout_ns = device, int(timeout_ns)
        case ["undriven", channel]:
            plan.undriven.append(channel)
        case ["sensor", name, kind]:
            plan.sensors.append(Sensor(name, kind))
        case ["output", channel, device]:
            plan.outputs.append(Output(channel, device))
        case ["pulse", index, signal, *bits]:
            plan.outputs[-1].pulses.append(Pulse(int(index), signal, *map(_double, bits)))
        case [keyword, *rest] if keyword in ("health", "limits", "tolerance", "bind"):
            _take_of_sensor(plan.sensors[-1], keyword, rest)
        case ["gpio_in", number, device, signal]:
            plan.pins.append(Pin(int(number), device, signal, None))
        case ["gpio_out", number, device, signal, safe]:
            plan.pins.append(Pin(int(number), device, signal, safe == "1"))
        case ["adc", number, device, signal]:
            plan.converters.append(Converter(int(number), device, signal))
        case ["registers", address, size, offset, access, *file]:
            write = access == "read_write"
            plan.registers.append(Registers(int(address), int(size), int(offset), write, " ".join(file)))
        case ["backend", device]:
            plan.sensors[-1].backends.append(Backend(device))
        case [keyword, *rest] if keyword in ("signal", "correct", "stick", "section"):
            _take_of_backend(plan.sensors[-1].backends[-1], keyword, rest)


def _take_of_sensor(sensor: Sensor, keyword: str, words: Sequence[str]) -> None:
    first, *rest = words
    if keyword == "health":
        sensor.health = (int(words[0]), int(words[1]), int(words[2]))
    elif keyword == "limits":
        sensor.limits[first] = [*map(_double, rest)]
    elif keyword == "tolerance":
        sensor.tolerances[first] = _double(rest[0])
    else:
        sensor.channels[first] = rest[0]


def _take_of_backend(backend: Backend, keyword: str, words: Sequence[str]) -> None:
    first, *rest = words
    if keyword == "signal":
        backend.signals[first] = rest[0]
        return
    numbers = [*map(_double, rest)]
    if keyword == "correct":
        backend.corrections[first] = Correction(numbers[:9], numbers[9:12], numbers[12:15], numbers[15])
    elif keyword == "stick":
        backend.sticks[int(first)] = numbers
    else:
        backend.sections.setdefault(first, []).append(numbers)


def _double(bits: str) -> float:
    value: float = struct.unpack(">d", bytes.fromhex(bits))[0]
    return value
