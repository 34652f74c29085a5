# SPDX-License-Identifier: Apache-2.0
"""A compiled machine and the reference side by side: what is done is done to both, and every field is compared."""

from __future__ import annotations

import ctypes as c
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fcsl_test_abi import _CTYPES, TYPES, Machine

from fcsl_compiler.passes import compile_machine
from fcsl_compiler.reference.machine import Host, ReferenceMachine
from fcsl_compiler.toolchain import toolchain


def bits(value: Any) -> Any:
    """What must be equal: every NaN is one, zeros have signs."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value).hex()
    return value


class Twins:
    """`native` is the compiled machine; `memory` is the reference's, laid out like it."""

    def __init__(self, config: Path):
        self.native = Machine.build(config)
        checked = compile_machine(config, toolchain(), until="schedule").checked
        self.reference = ReferenceMachine(checked, config, self.native.layout())
        self.memory = bytearray(self.native.d.size)
        self._host = Host()
        self.init()

    def init(self) -> None:
        assert self.native.d.init(self.native.base) == 0
        assert self.reference.init(self.memory) == 0
        self.check("after init")

    def use_clock(self, now_ns: Callable[[], int]) -> None:
        """The same readings for both: each of them reads the clock as often."""
        self.native.use_clock(now_ns)
        self._host.clock_ns = now_ns

    def step(self, ticks: int = 1, where: str = "") -> None:
        """Steps both and compares."""
        for _ in range(ticks):
            self.native.step()
            self.reference.step(self.memory, self._host)
            self.check(where)

    def force_state(self, name: str) -> None:
        self.native.force_state(name)
        self.reference.force_state(self.memory, self.native.states.index(name))

    def get(self, path: str) -> Any:
        return self.native.get(path)

    def set(self, path: str, value: Any) -> None:
        self.native.set(path, value)
        self._copy(self.native.fields[path].offset, self.native.fields[path].size)

    def set_byte(self, offset: int, value: int) -> None:
        """One byte that no field shows: a channel's, or an injected overrun."""
        self.native.byte(offset)[0] = value
        self._copy(offset, 1)

    def _copy(self, offset: int, size: int) -> None:
        self.memory[offset : offset + size] = c.string_at(self.native.base + offset, size)

    def of_reference(self, path: str) -> list[Any]:
        """The scalars of a field in the reference's memory."""
        f = self.native.fields[path]
        return list((_CTYPES[f.type] * f.count).from_buffer_copy(self.memory, f.offset))

    def check(self, where: str = "") -> None:
        """Every field is equal, bit for bit."""
        if self.native.save() == self.memory:
            return
        for path, f in self.native.fields.items():
            one, other = list(self.native.raw(path)), self.of_reference(path)
            same = [bits(v) for v in one] == [bits(v) for v in other]
            assert same, f"{where}: {path} ({TYPES[f.type]}): compiled {one}, CPython {other}"
