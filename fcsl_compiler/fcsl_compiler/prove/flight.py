# SPDX-License-Identifier: Apache-2.0
"""The machine in CPython (reference/machine.py): its fields when a flight begins, and a flight on given inputs."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..emit.fault_places import FaultPlaces
from ..emit.field_table import FieldRow, field_table
from ..emit.names import sensors
from ..model.machine import Machine
from ..model.types import SCALARS
from ..reference.algorithm import Extern
from ..reference.machine import ReferenceMachine

_CODES = {"bool": "B", "i32": "i", "i64": "q", "u32": "I", "u64": "Q", "f32": "f", "f64": "d"}
_CELL = 8


#: Makes the callable of a declared extern (reference/externs.py).
Externs = Callable[[Extern], Callable[..., Any]]


class StartFaulted(Exception):
    """`start` of an instance faulted: the machine does not begin. args: its name."""


class Flight:
    """A machine in CPython. `lowered`: the same after the pass of that name, for the table of its fault places."""

    def __init__(self, machine: Machine, lowered: Machine, externs: Externs | None = None):
        self.m, self.rows = machine, {row.path: row for row in field_table(machine)}
        self.layout: dict[str, int] = {}
        at = 0
        for path, row in self.rows.items():
            self.layout[path] = at
            at += row.count * _CELL
        hidden = ["machine.current"]
        hidden += [f"{i.name}.{name}" for i in machine.instances for name in ("inject_fault", "inject_overrun")]
        hidden += [f"channels.{c.name}.{n}" for c in sensors(machine) for n in ("attached", "fresh", "sample_age")]
        for path in hidden:
            self.layout[path] = at
            at += _CELL
        self.places = [(p.file, p.line, p.column, p.cause) for p in FaultPlaces(lowered).rows]
        self.reference = ReferenceMachine(machine, self.layout, self.places, externs)
        self._faults: dict[str, int] = {}
        self._cells = {
            path: (struct.Struct(_format(row)).unpack_from, self.layout[path], row.abi_type == "FCSL_BOOL")
            for path, row in self.rows.items()
        }
        ports = {
            c.name: f"{machine.instances[c.port.instance].name}.{c.port.record}.{c.port.path}" for c in sensors(machine)
        }
        self._sampled = {
            name: [p for p in self.rows if p == port or p.startswith((f"{port}.", f"{port}["))]
            for name, port in ports.items()
        }
        self.memory = bytearray(at)
        self.begin()

    def begin(self) -> None:
        """Puts it back to the beginning. Raises StartFaulted."""
        self.reference.init(self.memory)
        status = self.reference.start(self.memory)
        if status:
            raise StartFaulted(self.m.instances[status - 1].name)
        for channel in sensors(self.m):
            self.memory[self.layout[f"channels.{channel.name}.attached"]] = 1

    def sensors(self) -> list[str]:
        return [channel.name for channel in sensors(self.m)]

    def tick(self, samples: Mapping[str, bool], values: Mapping[str, Sequence[Any]]) -> None:
        """One tick on these inputs (tick.Inputs). Values of sensors without a sample are passed over."""
        silent = {path for name, came in samples.items() if not came for path in self._sampled[name]}
        for name, came in samples.items():
            self.memory[self.layout[f"channels.{name}.fresh"]] = came
            struct.pack_into("=I", self.memory, self.layout[f"channels.{name}.sample_age"], 0)
        for path, given in values.items():
            if path not in silent:
                self.write(path, given)
        self._faults = {i.name: self.read(f"{i.name}.counters.faults")[0] for i in self.m.instances}
        self.reference.step(self.memory)

    def fault_of(self, instance: str) -> str:
        """Place of the fault of an instance in the last tick, as `file:line:column`; "" without."""
        if self.read(f"{instance}.counters.faults")[0] == self._faults[instance]:
            return ""
        file, line, column, _ = self.places[self.read(f"{instance}.counters.fault_place")[0] - 1]
        return f"{file}:{line}:{column}"

    def read(self, path: str) -> tuple[Any, ...]:
        unpack, at, is_bool = self._cells[path]
        found = unpack(self.memory, at)
        return tuple(map(bool, found)) if is_bool else found

    def fields(self) -> dict[str, tuple[Any, ...]]:
        return {path: self.read(path) for path in self.rows}

    def write(self, path: str, values: Sequence[Any]) -> None:
        struct.pack_into(_format(self.rows[path]), self.memory, self.layout[path], *values)


def _format(row: FieldRow) -> str:
    code = next((_CODES[s.name] for s in SCALARS.values() if s.abi == row.abi_type and s.name in _CODES), "i")
    return f"={row.count}{code}"
