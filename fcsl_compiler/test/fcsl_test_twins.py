# SPDX-License-Identifier: Apache-2.0
"""A compiled machine and the reference side by side. All actions apply to both, and every field is compared."""

from __future__ import annotations

import ctypes as c
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fcsl_test_abi import HEALTH, TYPES, Machine

from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.externs import build_externs
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain
from fcsl_compiler.model.machine import Machine as Checked
from fcsl_compiler.reference.algorithm import Extern
from fcsl_compiler.reference.externs import externs_of
from fcsl_compiler.reference.machine import Host, ReferenceMachine

#: Makes the callable for a declared extern.
Externs = Callable[[Extern], Callable[..., Any]]


def bits(value: Any) -> Any:
    """Representation for comparison: all NaNs are equal, zeros keep their signs."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value).hex()
    return value


def event_bits(type_: str, value: Any) -> int:
    """A value of an event as fcsl_event_t has it."""
    if type_ == "f64":
        return int.from_bytes(struct.pack("<d", value), "little")
    if type_ == "f32":
        return int.from_bytes(struct.pack("<f", value), "little")
    return (HEALTH.index(value) if type_ == "health" else int(value)) & 2**64 - 1


class InReference(Machine):
    """The tables of a compiled machine and an identical memory, in which CPython runs init, step and force_state."""

    def __init__(self, library: Path, checked: Checked, *, init: bool = True, externs: Externs | None = None):
        super().__init__(library, checked.name, init=False)
        self.reference = ReferenceMachine(checked, self.layout(), self.fault_places(), externs, self.event_rows())
        self.memory = memoryview((c.c_ubyte * self.d.size).from_address(self.base)).cast("B")
        self._python_host = Host(event=self._tell)
        self.init_result = self.run_init() if init else None

    @classmethod
    def build(cls, config: Path, *, init: bool = True) -> InReference:
        built, checked = build_machine(config), compile_machine(config, toolchain(), until="schedule").checked
        externs = externs_of(build_externs(config)) if checked.externs else None
        return cls(built.library, checked, init=init, externs=externs)

    def run_init(self) -> int:
        self.reference.init(self.memory)
        return self.reference.start(self.memory)

    def use_clock(self, now_ns: Callable[[], int]) -> None:
        self._python_host.clock_ns = now_ns

    def use_hardware(self, functions: Mapping[str, Callable[..., Any]]) -> None:
        self._python_host.hardware = {f"hw_{name}": function for name, function in functions.items()}

    def step(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self._events.count = self._events.lost = 0
            self.reference.step(self.memory, self._python_host)

    def _tell(self, site: int, values: Sequence[Any]) -> None:
        if self._events.count == len(self._events.list):
            self._events.lost += 1
            return
        row = self._events.list[self._events.count]
        types = self.d.event_sites[site].types
        packed = [event_bits(TYPES[type_], value) for type_, value in zip(types, values, strict=False)]
        row.site, row.values[:] = site, [*packed, *[0] * (4 - len(packed))]
        self._events.count += 1

    def force_state(self, name: str) -> None:
        self.reference.force_state(self.memory, self.states.index(name))


class Twins:
    """Both machines, each with its own memory."""

    def __init__(self, config: Path):
        self.native, self.python = Machine.build(config, init=False), InReference.build(config, init=False)
        self.init()

    def init(self) -> None:
        assert self.native.initialise() == 0 and self.python.run_init() == 0
        self.check("after init")

    def step(self, ticks: int = 1, where: str = "") -> None:
        """Steps both and compares."""
        for _ in range(ticks):
            self.native.step()
            self.python.step()
            self.check(where)

    def get(self, path: str) -> Any:
        return self.native.get(path)

    def set(self, path: str, value: Any) -> None:
        self.native.set(path, value)
        self.python.set(path, value)

    def expect(self, rows: list[tuple[dict[str, Any], dict[str, Any]]]) -> None:
        """One tick per row: values set before it, and expected values after it."""
        for tick, (inputs, expected) in enumerate(rows):
            for path, value in inputs.items():
                self.set(path, value)
            self.step(where=f"tick {tick}")
            assert {path: self.get(path) for path in expected} == expected, f"tick {tick}"

    def check(self, where: str = "") -> None:
        """Asserts that every field and all events are equal bit for bit."""
        assert self.native.told() == self.python.told(), where
        if self.native.save() == self.python.save():
            return
        for path, f in self.native.fields.items():
            one, other = list(self.native.raw(path)), list(self.python.raw(path))
            same = [bits(v) for v in one] == [bits(v) for v in other]
            assert same, f"{where}: {path} ({TYPES[f.type]}): compiled {one}, CPython {other}"
