# SPDX-License-Identifier: Apache-2.0
"""Facts from the compiled code of a machine: instruction bounds of its instances and states, and code size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..driver.toolchain import compile_objects
from ..emit.identical_code_folding import first_identical
from ..emit.instances import execute_name
from ..emit.names import instance_type
from ..emit.status_elision import quiet_instances
from ..model.machine import Machine, State
from .bound import Bound, Bounder, Memory
from .instruction_table import most, usual
from .objects import Address, ObjectFile, read_object, read_words
from .schedule_facts import NEVER, Slot, major_cycle

_MACHINE_ARGUMENT = "rdi"  # the first argument of step (System V ABI)


@dataclass(frozen=True)
class Layout:
    """Size in bytes of the machine's struct and of every instance's record, and offsets of the fields that control a
    tick."""

    machine: int
    tick_at: int
    state_at: int
    next_state_at: int
    instances: tuple[int, ...]


@dataclass(frozen=True)
class Cost:
    """Instructions of the machine's own code; with its calls of fcsl_math, libm and libc in the worst case; and with
    these calls in the usual case."""

    own: int
    whole: int
    usual: int
    code: dict[Address, int]  # sizes in bytes of the reachable blocks
    apart: frozenset[str]  # called and not counted
    math: frozenset[str]  # called and counted from the table


def _cost(bounds: list[tuple[Bound, Bound, Bound]]) -> Cost:
    """The maximum of each of the three numbers. They may belong to different paths."""
    own, whole, usual = (max(b.instructions for b in column) for column in zip(*bounds, strict=True))
    return Cost(
        own,
        whole,
        usual,
        {a: n for b, _, _ in bounds for a, n in b.code.items()},
        frozenset().union(*(b.apart for b, _, _ in bounds)),
        frozenset().union(*(b.foreign for b, _, _ in bounds)),
    )


class MachineCode:
    """The object file of one machine, lowered. Raises NotReadable if it cannot be analysed."""

    def __init__(self, machine: Machine, compiled: Path, folder: Path, includes: Sequence[Path]):
        self.machine = machine
        self.code: ObjectFile = read_object(compiled)
        self.layout = _layout(machine, folder, includes)
        apart = frozenset(e.name for e in machine.externs)
        self.own = Bounder(self.code, apart)
        self.whole, self.usual = (Bounder(self.code, apart, price) for price in (most, usual))

    def _bounds(self, function: str, known: Memory | None = None) -> tuple[Bound, Bound, Bound]:
        own = self.own.of(function, known)
        if not own.foreign:
            return own, own, own
        return own, self.whole.of(function, known), self.usual.of(function, known)

    def execute(self, instance: int) -> Cost:
        """Cost of one call of the instance's execute, including the code around the algorithm. Raises Unbounded."""
        first = self.machine.instances[first_identical(self.machine, quiet_instances(self.machine))[instance]]
        return _cost([self._bounds(execute_name(self.machine, first))])

    def step(self, state: State, slot: Slot | None) -> Cost:
        """Cost of one tick in this state in which these entries are due (None: any of them, or all), with any previous
        state. Raises Unbounded."""
        m, at, name = self.machine, self.layout, f"fcsl_step_{self.machine.name}"
        now = m.states.index(state)
        # If algorithms compute with the tick, the bound must apply to every tick, so no value is assumed for it.
        tick = ("", _typical(state, slot)) if slot is not None and not _reads_tick(m) else None
        bounds = []
        for before in range(len(m.states)):
            known: Memory = {
                (_MACHINE_ARGUMENT, at.tick_at): (8, tick),
                (_MACHINE_ARGUMENT, at.state_at): (4, ("", before)),
                (_MACHINE_ARGUMENT, at.next_state_at): (4, ("", now)),
            }
            bounds.append(self._bounds(name, known))
        return _cost(bounds)

    @property
    def code_bytes(self) -> int:
        return sum(n for name, n in self.code.sections.items() if name.startswith(".text"))

    @property
    def constant_bytes(self) -> int:
        """Bytes of constants that the code reads: literals, tables, constant arrays."""
        return sum(n for name, n in self.code.sections.items() if _is_constant(name))

    @property
    def descriptor_bytes(self) -> int:
        """Bytes used only by hosts: names, units, field tables."""
        return sum(n for name, n in self.code.sections.items() if name.startswith((".rodata.str", ".data.rel.ro")))


def _typical(state: State, slot: Slot) -> int:
    """A typical tick of this slot. Tick 0 is not typical, because it skips delayed connections."""
    cycle = major_cycle(state.entries)
    return slot.first or (cycle if cycle < NEVER else 0)


def _reads_tick(machine: Machine) -> bool:
    """Whether an algorithm reads the tick or the time. Every slot is then bounded as if all entries were due."""
    return any(c.source.instance < 0 and c.source.field in ("tick", "time_ns") for c in machine.connections)


def _is_constant(section: str) -> bool:
    return section.startswith(".rodata") and not section.startswith(".rodata.str")


def _layout(machine: Machine, folder: Path, includes: Sequence[Path]) -> Layout:
    """The struct layout of the C compiler."""
    own = f"{machine.name}_t"
    values = [f"sizeof({own})", *(f"offsetof({own}, {f})" for f in ("tick", "state_", "next_state_"))]
    values += [f"sizeof({instance_type(machine, i)})" for i in machine.instances]
    source = folder / "layout.c"
    lines = ", ".join(values)
    source.write_text(
        f'#include "{machine.name}.h"\n#include <stddef.h>\nextern const uint64_t fcsl_layout[];\n'
        f"const uint64_t fcsl_layout[] = {{{lines}}};\n"
    )
    found = read_words(compile_objects([source], includes, folder)[0], ".rodata")
    return Layout(found[0], found[1], found[2], found[3], tuple(found[4 : len(values)]))
