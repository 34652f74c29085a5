# SPDX-License-Identifier: Apache-2.0
"""Everything a function can reach and the stack it needs, from the instructions of the linked library alone.

Every instruction that can follow another is looked at once, with the depth of the stack there. What changes the stack pointer
by an amount that is not in the instruction, jumps somewhere unknown or enters the kernel is a failure that says where.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from ..shared.cases import CheckFailed
from .code import Code, Instruction

RED_ZONE_BYTES = 128
_WORD_BYTES = 8
_MAX_INSTRUCTIONS = 200_000
_KERNEL = frozenset("syscall sysenter int int3 int1 hlt in out iret iretq sysret".split())
_ENDS = frozenset("ret ud2".split())
#: Functions of the C library that do not return.
_LAST = frozenset("__stack_chk_fail __chk_fail __assert_fail abort exit _exit".split())
_STACK = "%rsp"
_BELOW = re.compile(r"-0x[0-9a-f]+\(%rsp")
_IMMEDIATE = re.compile(r"\$(-?0x[0-9a-f]+),%rsp$")
_LEA = re.compile(r"lea +(-?0x[0-9a-f]+)?\((%rsp|%rbp)\),%rsp$")


@dataclass(frozen=True)
class Depth:
    """Bytes below the caller's stack pointer: of %rsp, and of %rbp where it holds a frame."""

    stack: int
    frame: int | None = None


@dataclass
class Function:
    """What one function does itself; calls with the depth at which they are made, return address not included."""

    name: str
    address: int
    deepest: int = 0
    calls: list[tuple[int, int]] = field(default_factory=list)  # depth, address
    imports: list[tuple[int, str]] = field(default_factory=list)  # depth, symbol
    indirect: list[int] = field(default_factory=list)  # addresses of calls through a pointer
    taken: list[int] = field(default_factory=list)  # addresses of code that it computes
    instructions: int = 0


@dataclass(frozen=True)
class Closure:
    """All that can be reached from some functions."""

    functions: dict[int, Function]
    bounds: dict[int, int]  # bytes of stack of each, return address included
    chains: dict[int, int]  # functions in the longest chain of calls that begins there: finite, without recursion

    @property
    def imports(self) -> list[str]:
        return sorted({name for f in self.functions.values() for _, name in f.imports})

    @property
    def indirect(self) -> list[int]:
        return sorted(a for f in self.functions.values() for a in f.indirect)


def closure(code: Code, entries: list[int], leaf_bytes: Callable[[str], int]) -> Closure:
    """Follows `entries`; `leaf_bytes` tells what an imported function needs. Raises CheckFailed, also for recursion."""
    functions: dict[int, Function] = {}
    bounds: dict[int, int] = {}
    chains: dict[int, int] = {}

    def bound(address: int, above: tuple[int, ...]) -> int:
        if address in above:
            circle = [*above[above.index(address) :], address]
            raise CheckFailed(f"recursion: {' calls '.join(code.name(a) for a in circle)}")
        if address not in bounds:
            f = functions[address] = _Walk(code, address).function()
            found = [f.deepest]
            found += [depth + bound(callee, (*above, address)) for depth, callee in f.calls]
            found += [depth + leaf_bytes(name) for depth, name in f.imports]
            bounds[address] = max(found)
            chains[address] = 1 + max([*(chains[callee] for _, callee in f.calls), *(1 for _ in f.imports), 0])
        return bounds[address]

    for entry in entries:
        bound(entry, ())
    return Closure(functions, bounds, chains)


class _Walk:
    """All ways through one function. A jump to another function is one more way: it ends with the caller's return."""

    def __init__(self, code: Code, address: int):
        self._code = code
        self._found = Function(code.name(address), address)
        self._seen: dict[int, Depth] = {}
        self._open = [(address, Depth(_WORD_BYTES))]

    def function(self) -> Function:
        while self._open:
            address, depth = self._open.pop()
            before: list[Instruction] = []
            at: int | None = address
            while at is not None:
                if at in self._seen:
                    if self._seen[at] != depth:
                        self._fail(self._code.at(at), f"is reached with {self._seen[at]} and with {depth}")
                    break
                self._seen[at] = depth
                instruction = self._code.at(at)
                before.append(instruction)
                at, depth = self._step(instruction, depth, before)
                self._found.deepest = max(self._found.deepest, depth.stack)
            if len(self._seen) > _MAX_INSTRUCTIONS:
                raise CheckFailed(f"{self._found.name}: more than {_MAX_INSTRUCTIONS} instructions")
        self._found.instructions = len(self._seen)
        return self._found

    def _fail(self, i: Instruction, why: str) -> None:
        where = f"{self._code.elf.path.name}: {self._code.name(i.address)}: {i.address:#x}: `{i.text.split('  ')[0]}`"
        raise CheckFailed(f"{where} {why}")

    def _step(self, i: Instruction, depth: Depth, before: list[Instruction]) -> tuple[int | None, Depth]:
        """The instruction that follows, and the depth there. Other ways are left open."""
        if i.op in _KERNEL:
            self._fail(i, "enters the kernel")
        if i.op == "(bad)" or i.op.startswith("."):
            self._fail(i, "is no instruction")
        if _BELOW.search(i.text):
            # How far below is not always in the instruction; the red zone ends there, and no signal may use it.
            self._found.deepest = max(self._found.deepest, depth.stack + RED_ZONE_BYTES)
        if i.op in _ENDS:
            if i.op == "ret" and depth.stack != _WORD_BYTES:
                self._fail(i, f"returns {depth.stack - _WORD_BYTES} bytes too deep")
            return None, depth
        if i.op == "call":
            return (i.next if self._call(i, depth) else None), depth
        if i.op == "lea" and i.reference is not None and self._code.holds(i.reference):
            self._found.taken.append(i.reference)
        if i.op.startswith("j"):
            return self._jump(i, depth, before), depth
        return i.next, self._moved(i, depth)

    def _call(self, i: Instruction, depth: Depth) -> bool:
        """Whether it returns."""
        stub = self._code.at(i.target) if i.target is not None else i
        if stub.op == "endbr64":  # where compilers mark what may be jumped to
            stub = self._code.at(stub.next)
        if stub.op == "jmp" and stub.reference is not None or i.reference is not None:
            return self._imported(stub, depth.stack)
        if i.target is None:
            self._found.indirect.append(i.address)
            self._found.deepest = max(self._found.deepest, depth.stack + _WORD_BYTES)
        elif self._ends_process(i.target):
            return False
        else:
            self._found.calls.append((depth.stack, i.target))
        return True

    def _ends_process(self, address: int) -> bool:
        return not _LAST.isdisjoint(self._code.elf.names_at(address))

    def _imported(self, i: Instruction, depth: int) -> bool:
        """A call or jump through the library's table of pointers, which the loader fills in. Whether it returns."""
        kind, name, addend = self._code.elf.relocations.get(i.reference or 0, ("", "", 0))
        if name:
            self._found.imports.append((depth, name))
        elif kind == "R_X86_64_RELATIVE":
            self._found.calls.append((depth, addend))
        else:
            self._fail(i, "calls through a variable")
        return name not in _LAST

    def _jump(self, i: Instruction, depth: Depth, before: list[Instruction]) -> int | None:
        if i.target is not None:
            if i.op == "jmp":
                return None if self._ends_process(i.target) else i.target
            if self._ends_process(i.target):
                return i.next
            self._open.append((i.target, depth))
            return i.next
        if i.reference is not None:  # a stub of the linker's, or a call as the last thing that a function does
            self._imported(i, depth.stack - _WORD_BYTES)
            return None
        targets = self._code.table(i, before)
        if targets is None:
            if depth.stack != _WORD_BYTES:
                self._fail(i, "jumps to an unknown place")
            self._found.indirect.append(i.address)  # a call through a pointer as the last thing
        self._open += [(target, depth) for target in targets or ()]
        return None

    def _moved(self, i: Instruction, depth: Depth) -> Depth:
        """The depth after an instruction that neither calls nor jumps."""
        op, last = i.op, i.operands.rpartition(",")[2]
        if op in ("push", "pushf"):
            return Depth(depth.stack + _WORD_BYTES, depth.frame)
        if op in ("pop", "popf"):
            if last == _STACK:
                self._fail(i, "sets the stack pointer")
            return Depth(depth.stack - _WORD_BYTES, None if last == "%rbp" else depth.frame)
        if op == "leave":
            return self._to_frame(i, depth, -_WORD_BYTES, None)
        if last == "%rbp" and op not in ("cmp", "test"):
            return Depth(depth.stack, depth.stack if i.operands == "%rsp,%rbp" else None)
        if last == _STACK and op not in ("cmp", "test"):
            return self._set(i, depth)
        return depth

    def _to_frame(self, i: Instruction, depth: Depth, more: int, frame: int | None) -> Depth:
        if depth.frame is None:
            self._fail(i, "sets the stack pointer to what is no frame")
        return Depth((depth.frame or 0) + more, frame)

    def _set(self, i: Instruction, depth: Depth) -> Depth:
        immediate, lea = _IMMEDIATE.search(i.text), _LEA.search(i.text)
        value = _signed(immediate[1]) if immediate else 0
        if immediate and i.op in ("sub", "add"):
            return Depth(depth.stack + (value if i.op == "sub" else -value), depth.frame)
        if immediate and i.op == "and" and value < 0:
            return Depth(depth.stack - value - 1, depth.frame)
        if lea and lea[2] == _STACK:
            return Depth(depth.stack - _signed(lea[1] or "0x0"), depth.frame)
        if lea:
            return self._to_frame(i, depth, -_signed(lea[1] or "0x0"), depth.frame)
        if i.operands == "%rbp,%rsp":
            return self._to_frame(i, depth, 0, depth.frame)
        self._fail(i, "moves the stack pointer by an amount that is not known")
        return depth


def _signed(text: str) -> int:
    value = int(text, 16)
    return value - (1 << 64) if value >= 1 << 63 else value
