# SPDX-License-Identifier: Apache-2.0
"""Drivers of sensors and actuators, and the devices that they open."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable, Mapping
from ctypes import byref, c_uint64
from dataclasses import dataclass

from ..board.native import why_text
from .driver_abi import (
    ABSENT,
    ACTUATOR,
    NEEDED,
    NO_BYTES,
    NO_FRAMES,
    NOTHING,
    OK,
    OPTIONAL,
    REASON_BYTES,
    SCALARS,
    SENSOR,
    UNUSED,
    CInput,
    find_driver,
)
from .errors import Refused

_NO_REASON = "the driver gives no reason"
Values = dict[str, list[float]]


@dataclass(frozen=True)
class Signal:
    name: str
    type: str
    count: int
    unit: str
    doc: str

    @property
    def type_text(self) -> str:
        return f"{self.type}[{self.count}]" if self.count > 1 else self.type


@dataclass(frozen=True)
class Sample:
    """`time_ns`: monotonic. A value that the device does not tell is NaN."""

    time_ns: int
    values: Values


class Driver:
    """A driver by the name that a board gives it: NAME, or LIBRARY.so:NAME. Raises TwinError where there is none."""

    def __init__(self, name: str, direction: int):
        self.name, self.direction = name, direction
        self.abi = find_driver(name, direction)
        self.doc = _text(self.abi.doc)
        self.waits = bool(self.abi.waits)
        self._places = [self.abi.signals[i] for i in range(self.abi.signal_count)]
        self.signals = [
            Signal(_text(s.name), SCALARS[s.type][0], s.count, _text(s.unit), _text(s.doc)) for s in self._places
        ]

    def probe(self, address: str) -> tuple[int, str]:
        """The driver's status and its reason. Opens and changes nothing."""
        why = ctypes.create_string_buffer(REASON_BYTES)
        status: int = self.abi.probe(os.fsencode(address), ctypes.addressof(why), REASON_BYTES)
        return status, "" if status == OK else _text(why.value) or _NO_REASON

    def open(self, address: str, needed: Iterable[str] = (), optional: Iterable[str] = ()) -> Device:
        """Raises Refused."""
        return Device(self, address, needed, optional)

    def bind(self, state: int) -> dict[str, ctypes.Array[ctypes._SimpleCData[float]]]:
        """The values of all signals inside an opened device's struct."""
        pairs = zip(self.signals, self._places, strict=True)
        return {s.name: (SCALARS[p.type][1] * p.count).from_address(state + p.offset) for s, p in pairs}


def any_driver(name: str) -> Driver:
    """A sensor's or an actuator's. Raises TwinError where there is neither."""
    try:
        return Driver(name, ACTUATOR)
    except ValueError:
        return Driver(name, SENSOR)


class Device:
    """An open device. Its functions are to be called from one thread."""

    def __init__(self, driver: Driver, address: str, needed: Iterable[str], optional: Iterable[str]):
        self.driver, self.address = driver, address
        abi, uses = driver.abi, {**dict.fromkeys(optional, OPTIONAL), **dict.fromkeys(needed, NEEDED)}
        lacking = [name for name in uses if name not in {s.name for s in driver.signals}]
        if lacking:
            raise Refused(f"driver '{driver.name}' has no signal '{lacking[0]}'")
        align = max(abi.state_align, 64)
        self._memory = ctypes.create_string_buffer(abi.state_size + align)
        self._state = -(-ctypes.addressof(self._memory) // align) * align
        self._used = (ctypes.c_uint8 * abi.signal_count)(*(uses.get(s.name, UNUSED) for s in driver.signals))
        self._address = ctypes.create_string_buffer(os.fsencode(address))  # the driver may keep it until close
        self._why = ctypes.create_string_buffer(REASON_BYTES)
        self._values = {name: values for name, values in driver.bind(self._state).items() if name in uses}
        self._input = CInput.from_address(self._state + abi.input) if abi.input else None
        self._silence = 0
        self._is_open = False
        self._open()

    def _open(self) -> None:
        status, why = self.driver.probe(self.address)
        if status == OK:
            address = ctypes.cast(self._address, ctypes.c_char_p)
            used = ctypes.addressof(self._used)
            status = self.driver.abi.open(self._state, address, used, *self._reason())
            why = self._why_text()
        if status != OK:
            what = "is not there" if status == ABSENT else "cannot be opened"
            raise Refused(f"device '{self.address}' of driver '{self.driver.name}' {what}: {why or _NO_REASON}")
        self._is_open = True

    def _reason(self) -> tuple[int, int]:
        """The arguments of a driver's function for its reason."""
        self._why.value = b""
        return ctypes.addressof(self._why), REASON_BYTES

    def _why_text(self) -> str:
        return _text(self._why.value) or _NO_REASON

    def read(self) -> Sample | None:
        """A sample; None: there is none yet. A driver that waits does so for 0.1 s at most. Raises Refused."""
        sample_ns = c_uint64()
        if self._input is not None:
            ctypes.memset(byref(self._input), 0, ctypes.sizeof(CInput))
        status = self.driver.abi.read(self._state, byref(sample_ns), *self._reason())
        if self._input is not None:
            silence = self._input.why or (NO_FRAMES if self._input.bytes else NO_BYTES)
            self._silence = 0 if status == OK else max(self._silence, silence)
        if status == NOTHING:
            return None
        if status != OK:
            if status == ABSENT:
                self.close()
            raise Refused(f"device '{self.address}' of driver '{self.driver.name}': {self._why_text()}")
        return Sample(sample_ns.value, {name: [float(v) for v in values] for name, values in self._values.items()})

    def silence(self) -> str:
        """Why no sample has come since the last one; "" where the driver does not tell what arrives."""
        return why_text(self._silence)

    def write(self, values: Mapping[str, float]) -> None:
        """Sets scalars and drives the device with all used signals. Raises Refused."""
        for name, value in values.items():
            self._values[name][0] = value
        if self.driver.abi.write(self._state, *self._reason()) != OK:
            raise Refused(f"device '{self.address}' of driver '{self.driver.name}': {self._why_text()}")

    def close(self) -> None:
        if self._is_open:
            self._is_open = False
            self.driver.abi.close(self._state)

    def __enter__(self) -> Device:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _text(data: bytes | None) -> str:
    return (data or b"").decode(errors="replace")
