# SPDX-License-Identifier: Apache-2.0
"""Effects on known values (values.py) that instructions share."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .arithmetic import binary
from .values import CALLER_SAVED, NAMES, Flags, State, Value, number, part, plus

Effect = Callable[[State], None]


def escaping(read: Callable[[State], Value], write: Callable[[State, Value], None]) -> Effect:
    def run(s: State) -> None:
        value = read(s)
        s.escape(value)
        write(s, value)

    return run


def after_call(
    s: State, clobbered: frozenset[int] = CALLER_SAVED, written: Iterable[tuple[object, int, int]] = ()
) -> None:
    """Forgets what a called function may have changed: registers and memory. `written`: its stores to addresses
    relative to registers on its entry."""
    before = s.registers[:]
    for n in clobbered:
        s.registers[n] = None
    s.flags = None
    s.forget()
    for base, offset, size in written:
        start = before[NAMES.index(base)] if base in NAMES else None
        if start is None:
            s.memory = {k: v for k, v in s.memory.items() if k[0] == "rsp"}
        else:
            s.store(plus(part(start, 64), number(offset)), size, None)


def forget_flags(s: State) -> None:
    s.flags = None


def compare(s: State, name: str, left: Value, right: Value, bits: int) -> None:
    if name == "cmp":
        s.flags = Flags(left, right, bits) if left is not None and right is not None else None
    else:
        s.flags = Flags(binary("and", left, right, bits), None, bits)


def division(s: State) -> None:
    s.registers[0] = s.registers[2] = s.flags = None
