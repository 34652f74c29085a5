# SPDX-License-Identifier: Apache-2.0
"""x86-64 machine code, one instruction at a time, as objdump reads it."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass

from ..shared.cases import CheckFailed, run
from .elf import Elf, Section

_WINDOW_BYTES = 4096
#: An instruction is at most 15 bytes: what stands at the end of a window may be cut off.
_CUT_BYTES = 16
_LINE = re.compile(r"^ +([0-9a-f]+):\t(.*?)(?:\s+# ([0-9a-f]+) <.*)?$")
_PREFIXES = frozenset("notrack bnd lock rep repz repnz cs ds data16".split())
_CONDITION = re.compile(r"cmp[bwlq]? +\$0x([0-9a-f]+),")
_ADDED = re.compile(r"add +(%\w+),(%\w+)$")
_MAX_TABLE = 4096
#: How far before a jump through a table its bound and its address stand.
_TABLE_DISTANCE = 48


@dataclass(frozen=True)
class Instruction:
    """AT&T syntax; `reference` is the address that an operand relative to %rip stands for."""

    address: int
    text: str
    reference: int | None
    next: int

    @property
    def op(self) -> str:
        return next((w for w in self.text.split() if w not in _PREFIXES), "")

    @property
    def operands(self) -> str:
        return self.text.partition(self.op)[2].strip()

    @property
    def target(self) -> int | None:
        """Of a direct jump or call."""
        m = re.match(r"([0-9a-f]+) <", self.operands)
        return int(m[1], 16) if m else None


class Code:
    """The instructions of a library, disassembled where they are asked for."""

    def __init__(self, elf: Elf):
        self.elf = elf
        self._known: dict[int, Instruction] = {}
        self._functions = sorted((s.address, s.size, s.name) for s in elf.symbols if s.kind == "FUNC" and s.size)

    def at(self, address: int) -> Instruction:
        """Raises CheckFailed where there is none."""
        if address not in self._known:
            self._read(address)
        if address not in self._known:
            raise CheckFailed(f"{self.elf.path.name}: no code at {address:#x}")
        return self._known[address]

    def name(self, address: int) -> str:
        """Of the function that holds an address, or the address."""
        at = bisect_right(self._functions, (address, 1 << 62, "")) - 1
        start, size, name = self._functions[at] if at >= 0 else (0, 0, "")
        return name if start <= address < start + size else f"{address:#x}"

    def holds(self, address: int) -> bool:
        """Whether code lies there."""
        return self._section(address) is not None

    def _section(self, address: int) -> Section | None:
        executable = (s for s in self.elf.sections.values() if "X" in s.flags)
        return next((s for s in executable if s.address <= address < s.address + s.size), None)

    def _read(self, start: int) -> None:
        section = self._section(start)
        if section is None:
            return
        end = min(start + _WINDOW_BYTES, section.address + section.size)
        line = ["objdump", "-d", "-w", "--no-show-raw-insn", f"--start-address={start:#x}", f"--stop-address={end:#x}"]
        rows = [m for m in map(_LINE.match, run([*line, self.elf.path]).splitlines()) if m]
        addresses = [int(m[1], 16) for m in rows] + [end]
        for m, here, after in zip(rows, addresses[:-1], addresses[1:], strict=True):
            if end == section.address + section.size or after <= end - _CUT_BYTES:
                found = Instruction(here, m[2].strip(), int(m[3], 16) if m[3] else None, after)
                self._known.setdefault(here, found)

    def table(self, jump: Instruction, before: list[Instruction]) -> list[int] | None:
        """Where a jump through a table leads, as gcc writes a `switch`: `before` came ahead of it, the last one nearest.

        None when it is no such jump.
        """
        near = before[: -_TABLE_DISTANCE - 1 : -1]
        added = (m for m in (_ADDED.match(i.text) for i in near) if m)
        base = next((m[1] for m in added if jump.operands == f"*{m[2]}"), None)
        read = any(i.text.startswith(f"movslq ({base},") for i in near)
        start = next((i.reference for i in near if i.op == "lea" and read and i.text.endswith(f",{base}")), None)
        bound = next((m[1] for m in (_CONDITION.match(i.text) for i in near) if m), None)
        if start is None or bound is None or int(bound, 16) >= _MAX_TABLE:
            return None
        return [start + self.elf.word_at(start + 4 * n) for n in range(int(bound, 16) + 1)]
