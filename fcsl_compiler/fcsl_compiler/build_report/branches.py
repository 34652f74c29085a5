# SPDX-License-Identifier: Apache-2.0
"""Register values that follow from a conditional jump: on each path, compilers rely on what its condition implies."""

from __future__ import annotations

from .objects import Instruction
from .operands import REGISTERS
from .values import OPPOSITES

#: (on the taken path, register operand, its value there)
Lesson = tuple[bool, str, int]

_KEEP_FLAGS = (
    "mov",
    "lea",
    "set",
    "cmov",
    "push",
    "pop",
    "nop",
    "clt",
    "cqt",
    "not",
    "bswap",
    "punpck",
    "pxor",
    "shuf",
)
_RESULTS = ("add", "sub", "and", "or", "xor", "neg", "dec", "inc", "imul")


def lessons(instructions: list[Instruction]) -> tuple[Lesson, ...]:
    """Values that follow from the conditional jump at the end of a block."""
    condition = instructions[-1].mnemonic[1:]
    found: list[Lesson] = []
    changed: set[int] = set()
    for i in reversed(instructions[:-1]):
        if not i.operands:
            return tuple(found)
        target = i.operands[-1]
        number = REGISTERS.get(target[1:], (None, 0))[0]
        if i.mnemonic.startswith("set") and number is not None and number not in changed:
            found += _of_set(i.mnemonic[3:], condition, target)
        if i.mnemonic.startswith("xchg"):
            return tuple(found)
        if not i.mnemonic.startswith(_KEEP_FLAGS):
            if number is not None and number not in changed and condition in ("e", "ne"):
                found += _of_equality(i, condition == "e", target)
            return tuple(found)
        if number is not None:
            changed.add(number)
    return tuple(found)


def _of_set(made: str, condition: str, target: str) -> list[Lesson]:
    if made == condition:
        return [(True, target, 1), (False, target, 0)]
    if (made, condition) in OPPOSITES or (condition, made) in OPPOSITES:
        return [(True, target, 0), (False, target, 1)]
    return []


def _of_equality(i: Instruction, when_taken: bool, target: str) -> list[Lesson]:
    name = i.mnemonic.rstrip("bwlq") if i.mnemonic not in ("sub", "imul") else i.mnemonic
    if name == "cmp" and i.operands[0].startswith("$") and not i.symbol:
        return [(when_taken, target, int(i.operands[0][1:], 0))]
    same = name == "test" and i.operands[0] == target
    return [(when_taken, target, 0)] if same or name in _RESULTS[:-1] else []
