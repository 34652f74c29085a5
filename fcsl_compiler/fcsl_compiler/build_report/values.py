# SPDX-License-Identifier: Apache-2.0
"""Known values of a machine's registers, flags and memory at one point of its code.

A value is (base, offset): a number if the base is "" (unsigned, 64 bits), else an address relative to the base ("rdi":
the value of this register on entry; a section: its start; more in bases.py). For registers only: "byte": only the lowest 8
bits are known; "low": all but these are known. None: unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .bases import Aligned, Between, Low

Value = tuple[object, int] | None
#: Base and offset of a value in memory.
Cell = tuple[object, int]

WORD = (1 << 64) - 1
_NOTHING = 1 << 63
RSP = 4
NAMES = ("rax", "rcx", "rdx", "rbx", "rsp", "rbp", "rsi", "rdi", *(f"r{n}" for n in range(8, 16)))
#: Registers that a called function may change (System V ABI).
CALLER_SAVED = frozenset(NAMES.index(n) for n in ("rax", "rcx", "rdx", "rsi", "rdi", "r8", "r9", "r10", "r11"))


@dataclass(frozen=True)
class Flags:
    """Operands of the last comparison: `left` minus `right`, with `bits` bits. `right` is None for a plain result."""

    left: Value
    right: Value
    bits: int
    is_result: bool = False  # left is the result of an operation other than a comparison or test


@dataclass
class State:
    registers: list[Value] = field(default_factory=lambda: [(name, 0) for name in NAMES])
    flags: Flags | None = None
    memory: dict[Cell, tuple[int, Value]] = field(default_factory=dict)  # size in bytes and value by address
    escaped: int = _NOTHING  # lowest offset in this frame whose address was computed
    pinned: frozenset[Cell] = frozenset()  # not in arrays: only a store to exactly this address changes them
    written: set[tuple[object, int, int]] = field(
        default_factory=set, compare=False
    )  # base, offset, bytes; shared by all copies

    def copy(self) -> State:
        return State(self.registers[:], self.flags, dict(self.memory), self.escaped, self.pinned, self.written)

    def joined(self, other: State) -> State:
        """Values that agree in both states."""
        registers = [a if a == b else None for a, b in zip(self.registers, other.registers, strict=True)]
        memory = {k: v for k, v in self.memory.items() if other.memory.get(k) == v}
        flags = self.flags if self.flags == other.flags else None
        return State(registers, flags, memory, min(self.escaped, other.escaped), self.pinned, self.written)

    def load(self, address: Value, size: int) -> Value:
        if address is None:
            return None
        held = self.memory.get(address)
        if held is None or held[1] is None or held[0] < size:
            return None
        return held[1] if held[0] == size else part(held[1], size * 8)

    def store(self, address: Value, size: int, value: Value) -> None:
        """Records a store. Removes everything that it may overwrite."""
        if address is None:
            self.forget()
            return
        base, at = address
        if base != "rsp":
            self.written.add((base, at, size))
        for key in [k for k in self.memory if self._may_overlap(k, base, at, size)]:
            del self.memory[key]
        if value is not None:
            self.memory[address] = (size, value)

    def _may_overlap(self, key: Cell, base: object, at: int, size: int) -> bool:
        if key[0] == base:
            return key[1] < at + size and at < key[1] + self.memory[key][0]
        return "rsp" not in (key[0], base)

    def escape(self, address: Value) -> None:
        """Records that an address in this frame was copied from the stack pointer or indexed."""
        if address is not None and address[0] == "rsp":
            self.escaped = min(self.escaped, address[1])

    def forget(self) -> None:
        """Removes what a store to an unknown address may overwrite. Such a store reaches this frame only at or above
        the lowest computed address. Below it are only registers saved by the compiler."""
        self.memory = {k: v for k, v in self.memory.items() if k in self.pinned or self._is_put_away(k, v[0])}

    def _is_put_away(self, key: Cell, size: int) -> bool:
        return key[0] == "rsp" and key[1] + size <= self.escaped


def number(value: int) -> Value:
    return ("", value & WORD)


def part(value: Value, bits: int) -> Value:
    """The lowest bits, zero-extended."""
    if value is None or value[0] == "low":
        return None
    base, lowest = value[0], value[1] & ((1 << bits) - 1)
    if base == "" or base == "byte" and bits == 8:
        return ("", lowest)
    if isinstance(base, Between):
        return (base, lowest) if bits == 64 or lowest + base.most < 1 << bits else None
    if isinstance(base, Low):
        return value if bits >= 32 else None
    if base == "byte" or bits < 32:
        return None
    return value if bits == 64 else (Low(base), lowest)


def greatest(value: Value) -> int | None:
    """The greatest number that a value may be. None if it may be any."""
    if value is None or value[0] != "" and not isinstance(value[0], Between):
        return None
    most = value[1] + (value[0].most if isinstance(value[0], Between) else 0)
    return most if most <= WORD else None


def signed(value: int, bits: int) -> int:
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def plus(a: Value, b: Value, bits: int = 64) -> Value:
    if a is None or b is None:
        return None
    if a[0] == "" and b[0] == "":
        return ("", (a[1] + b[1]) & ((1 << bits) - 1))
    if "" not in (a[0], b[0]):
        return _table_entry(a, b)
    (base, offset), distance = (a, b[1]) if b[0] == "" else (b, a[1])
    if isinstance(base, Between):
        return part((base, offset + distance), bits)
    if isinstance(base, Low) or bits != 64:
        return part((base, offset + distance), bits) if isinstance(base, Low) and bits == 32 else None
    return (base, offset + signed(distance, 64)) if base != "byte" else None


def _table_entry(a: Value, b: Value) -> Value:
    """Sum of a jump table's word and the table's address. The word's base is (section of the code, the word's
    address)."""
    for word, table in ((a, b), (b, a)):
        assert word is not None and table is not None
        if isinstance(word[0], tuple) and table[0] == word[0][1][0]:
            return (word[0][0], word[1] - (word[0][1][1] - table[1]))
    return None


def minus(a: Value, b: Value, bits: int = 64) -> Value:
    if a is None or b is None:
        return None
    if a[0] == "" and b[0] == "":
        return ("", (a[1] - b[1]) & ((1 << bits) - 1))
    if b[0] == "":
        return plus(a, number(-b[1]), bits)
    if isinstance(a[0], Low) and isinstance(b[0], Low):
        return part(minus((a[0].base, a[1]), (b[0].base, b[1])), 32) if bits == 32 else None
    if bits != 64 or "byte" in (a[0], b[0]):
        return None
    if a[0] == b[0]:
        return number(a[1] - b[1])
    if isinstance(b[0], Aligned) and b[0].base == a[0]:
        return part((Between(("beyond", b[0]), b[0].step - 1), a[1] - b[0].at - b[1]), 64)
    return None


def decide(condition: str, flags: Flags | None) -> bool | None:
    """Whether a jump (`je`: "e") is taken. None if unknown."""
    if flags is None or flags.left is None:
        return None
    for word, positive in OPPOSITES:
        if condition == word:
            known = decide(positive, flags)
            return None if known is None else not known
    left = flags.left
    if flags.right is None or flags.is_result:
        if left[0] != "":
            return None
        if condition in ("e", "s"):
            return left[1] == 0 if condition == "e" else signed(left[1], flags.bits) < 0
        return _of_test(condition, signed(left[1], flags.bits)) if not flags.is_result else None
    if left[0] != flags.right[0] or left[0] == "byte" or isinstance(left[0], (Between, Low)):
        return None
    return _of_comparison(condition, left, flags.right[1], flags.bits)


OPPOSITES = (("ne", "e"), ("ae", "b"), ("a", "be"), ("ge", "l"), ("g", "le"), ("ns", "s"), ("no", "o"))


def _of_test(condition: str, result: int) -> bool | None:
    """Condition after `test` and logical operations, which clear carry and overflow."""
    if condition in ("be", "le", "l", "b"):
        return {"be": result == 0, "le": result <= 0, "l": result < 0, "b": False}[condition]
    return None


def _of_comparison(condition: str, left: tuple[object, int], right: int, bits: int) -> bool | None:
    a, b = left[1], right
    if condition == "e":
        return a == b
    if condition in ("b", "be"):
        return a < b if condition == "b" else a <= b
    if left[0] == "":
        a, b = signed(a, bits), signed(b, bits)
    if condition in ("l", "le"):
        return a < b if condition == "l" else a <= b
    return signed(a - b, bits) < 0 if condition == "s" else None
