# SPDX-License-Identifier: Apache-2.0
"""Operands of x86-64 instructions in AT&T notation: reads and writes them in the state of known values (values.py)."""

from __future__ import annotations

import re
from collections.abc import Callable

from .objects import Instruction, ObjectFile
from .values import NAMES, State, Value, number, part, plus


def _registers() -> dict[str, tuple[int, int]]:
    """Number and size in bytes of every general register. Registers of bits 8 to 15 have size 0."""
    found: dict[str, tuple[int, int]] = {}
    for n, name in enumerate(NAMES):
        found[name] = (n, 8)
        if n < 8:
            low = name[1:]
            found |= {"e" + low: (n, 4), low: (n, 2), (low[0] + "l" if n < 4 else low + "l"): (n, 1)}
        else:
            found |= {name + "d": (n, 4), name + "w": (n, 2), name + "b": (n, 1)}
    return found | {h: (n, 0) for n, h in enumerate(("ah", "ch", "dh", "bh"))}


REGISTERS = _registers()
_MEMORY = re.compile(r"^(%[fg]s:)?(-?(?:0x)?[0-9a-f]+)?\((%\w+)?(?:,(%\w+),(\d))?(?:,(\d))?\)$")


class Operands:
    """Evaluates operands of the instructions of one object."""

    def __init__(self, code: ObjectFile):
        self.code = code

    def address(self, i: Instruction, operand: str) -> Callable[[State], Value] | None:
        """Address of a memory operand. None for other operands."""
        m = _MEMORY.match(operand)
        if m is None:
            return None
        displacement = int(m[2], 0) if m[2] else 0
        if m[1]:
            return lambda s: None
        if m[3] == "%rip":
            target = self.code.address_of(i)
            # The distance counts from the end of the instruction, which an immediate may extend.
            return lambda s: target
        base = REGISTERS[m[3][1:]] if m[3] else None
        index, scale = (REGISTERS.get(m[4][1:]) if m[4] else None), int(m[5] or 1)
        if base and base[1] != 8 or m[4] and (index is None or index[1] != 8):
            return lambda s: None
        if index is None and base is not None:
            n = base[0]

            def simple(s: State) -> Value:
                v = part(s.registers[n], 64)
                return v if not displacement or v is None else plus(v, ("", displacement & ((1 << 64) - 1)))

            return simple

        def whole(s: State) -> Value:
            at = part(s.registers[base[0]], 64) if base is not None else ("", 0)
            if index is not None:
                by = part(s.registers[index[0]], 64)
                if by is not None and by[0] == "":
                    by = number(by[1] * scale)
                else:
                    s.escape(plus(at, number(displacement)))
                    by = None if scale != 1 else by
                at = plus(at, by)
            return plus(at, number(displacement))

        return whole

    def reader(self, i: Instruction, operand: str, size: int) -> Callable[[State], Value]:
        if operand.startswith("$"):
            constant = number(int(operand[1:], 0) & ((1 << size * 8) - 1)) if not i.symbol else None
            return lambda s: constant
        if operand[1:] in REGISTERS:
            n, own = REGISTERS[operand[1:]]
            if own == 0:
                return lambda s: None
            return lambda s: part(s.registers[n], own * 8)
        where = self.address(i, operand)
        if where is None:
            return lambda s: None
        return lambda s: self._load(s, where(s), size)

    def _load(self, s: State, address: Value, size: int) -> Value:
        found = s.load(address, size)
        if found is None and size == 4 and address is not None and isinstance(address[0], str):
            target = self.code.tables.get((address[0], address[1]))
            return ((target[0], address), target[1]) if target else None
        return found

    def writer(self, i: Instruction, operand: str, size: int) -> Callable[[State, Value], None]:
        if operand[1:] in REGISTERS:
            n, own = REGISTERS[operand[1:]]
            if own == 8:
                return lambda s, v: s.registers.__setitem__(n, None if v is not None and v[0] == "byte" else v)
            if own == 4:
                return lambda s, v: s.registers.__setitem__(n, part(v, 32))
            return lambda s, v: s.registers.__setitem__(n, _inserted(s.registers[n], v, own))
        where = self.address(i, operand)
        if where is None:
            return lambda s, v: None
        return lambda s, v: s.store(where(s), size, part(v, size * 8))


def _inserted(old: Value, new: Value, size: int) -> Value:
    """A register after a write of its lowest one or two bytes."""
    v = part(new, size * 8)
    above = ~((1 << size * 8) - 1)
    whole = old is not None and (old[0] == "" or old[0] == "low" and size == 1)
    if old is not None and whole:
        if v is not None:
            return ("", old[1] & above | v[1])
        return ("low", old[1] & above) if size == 1 else None
    return ("byte", v[1]) if size == 1 and v is not None else None
