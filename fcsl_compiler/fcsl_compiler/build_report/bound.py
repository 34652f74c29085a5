# SPDX-License-Identifier: Apache-2.0
"""Upper bound of the instructions that a call of a function executes: the longest path through its machine code.

The code is executed abstractly on known values (values.py). A branch with a known condition continues on one path, any
other branch on both. Where paths merge, values that agree stay known, and the longer path counts. A loop is executed
iteration by iteration until no path leads back to its start. Counters and pointers of compiled `for` loops are known in
every iteration, so the analysis terminates with the loop. Nothing is estimated: a loop whose end does not follow from
known values has no bound.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from .branches import lessons
from .effects import Effect, after_call
from .instruction_table import Missing, Price
from .objects import Address, Instruction, ObjectFile
from .operands import REGISTERS
from .paths import Block, Loop, Region, Unbounded, blocks_from, blocks_of, callee, region_of
from .semantics import Decoder
from .values import CALLER_SAVED, NAMES, Cell, State, Value, decide, greatest, number

#: Maximum number of blocks executed for one bound (some seconds).
_MOST_BLOCKS = 200_000
#: Target of paths that leave the function.
_RETURN: Address = ("return", 0)

#: Executes an instruction. Returns its additional cost, such as that of a callee.
Calling = Callable[[State], int]
#: Number of instructions, and the effect of the last of them.
Step = tuple[int, Callable[[State], int | None] | None]
#: Known values on entry, by address: size in bytes and value.
Memory = dict[Cell, tuple[int, Value]]
Flow = dict[Address, tuple[State, int]]


@dataclass(frozen=True)
class Bound:
    """Instructions of one call, including its callees in the same object. `apart`: callees that are not counted.
    `foreign`: callees with a price. `code`: reachable blocks with their sizes in bytes."""

    instructions: int
    code: dict[Address, int]
    apart: frozenset[str]
    foreign: frozenset[str]
    written: frozenset[tuple[object, int, int]]  # stores to addresses relative to registers on entry


@dataclass
class _Function:
    region: Region
    steps: dict[Address, list[Step]]
    blocks: dict[Address, Block]
    lessons: dict[Address, list[tuple[bool, Callable[[State, Value], None], Value]]]
    written: frozenset[int]


class Bounder:
    """Bounds of the functions of one object. `apart`: functions that are not counted, such as externs. `price`: cost of
    a call of fcsl_math, libm and libc, 0 if None. `turns`: iteration limits for loops whose end does not follow from
    known values, by function: (a mnemonic in the loop, maximum iterations including the last). The first match
    applies."""

    def __init__(
        self,
        code: ObjectFile,
        apart: frozenset[str] = frozenset(),
        price: Price | None = None,
        turns: Mapping[str, tuple[tuple[str, int], ...]] | None = None,
    ):
        self.code, self.apart, self.price, self.turns = code, apart, price, turns or {}
        self.reached: frozenset[Address] | None = None  # addresses that paths may reach; None: all
        self._functions: dict[Address, _Function] = {}
        self._known: dict[Address, Bound] = {}
        self._active: list[Address] = []
        self._blocks_left = 0
        self._called_apart: set[str] = set()
        self._foreign: set[str] = set()
        self._code: dict[Address, int] = {}

    def of(self, function: str, memory: Memory | None = None) -> Bound:
        """Bound of a call with any arguments. `memory`: values known on entry, which are scalars and not in arrays.
        Raises Unbounded, NotReadable."""
        if function not in self.code.functions:
            raise Unbounded(f"no function `{function}` in the object")
        self._blocks_left = _MOST_BLOCKS
        return self._call(self.code.functions[function], memory)

    def _call(self, entry: Address, memory: Memory | None = None) -> Bound:
        if not memory and entry in self._known:
            return self._known[entry]
        if entry in self._active:
            raise Unbounded("a function that calls itself")
        self._active.append(entry)
        before = (self._called_apart, self._foreign, self._code)
        self._called_apart, self._foreign, self._code = set(), set(), {}
        try:
            function = self._function(entry)
            state = State(memory=dict(memory or {}), pinned=frozenset(memory or {}))
            out = self._run(function, function.region, {entry: (state, 0)})
            most = out[_RETURN][1] if _RETURN in out else 0
            called = frozenset(self._called_apart), frozenset(self._foreign)
            bound = Bound(most, self._code, *called, frozenset(state.written))
        finally:
            self._active.pop()
            self._called_apart, self._foreign, self._code = before
        if not memory:
            self._known[entry] = bound
        return bound

    # ---- what a function is --------------------------------------------------------------------------------------

    def _function(self, entry: Address) -> _Function:
        if entry not in self._functions:
            blocks = blocks_from(self.code, entry)
            decoder = Decoder(self.code)
            steps = {a: self._steps(b, decoder) for a, b in blocks.items()}
            written = self._written(blocks)
            learned = {a: _learned(b, decoder) for a, b in blocks.items() if b.condition}
            self._functions[entry] = _Function(region_of(blocks, entry), steps, blocks, learned, written)
        return self._functions[entry]

    def _steps(self, block: Block, decoder: Decoder) -> list[Step]:
        """The steps of a block. Instructions without a tracked effect are counted with the next one that has an
        effect."""
        out: list[Step] = []
        count = 0
        for i in block.instructions:
            count += not i.mnemonic.startswith("rep ")
            effect: Callable[[State], int | None] | None = None
            if i.mnemonic == "call" or i.mnemonic == "jmp" and not block.successors:
                effect = self._calling(i)
            elif i.mnemonic.startswith("rep "):
                effect = _repeating(decoder.effect(i))
            elif not i.mnemonic.startswith("j") and i.mnemonic != "ret":
                effect = decoder.effect(i)
            if effect is not None:
                out.append((count, effect))
                count = 0
        return [*out, (count, None)]

    def _written(self, blocks: dict[Address, Block]) -> frozenset[int]:
        """Registers that a call may change. gcc knows these sets for its own functions and relies on them."""
        found: set[int] = set()
        for block in blocks.values():
            for i in block.instructions:
                target = callee(self.code, i) if i.mnemonic in ("call", "jmp") else None
                if isinstance(target, tuple) and i.mnemonic == "call":
                    if target in self._active:
                        raise Unbounded("a function that calls itself")
                    self._active.append(target)
                    try:
                        found |= self._function(target).written
                    finally:
                        self._active.pop()
                elif isinstance(target, str):
                    found |= CALLER_SAVED
                elif i.operands and not i.mnemonic.startswith(("cmp", "test", "j", "push")):
                    found |= _may_write(i.mnemonic, i.operands)
        return frozenset(found & CALLER_SAVED)

    # ---- executing -----------------------------------------------------------------------------------------------

    def _calling(self, i: Instruction) -> Calling:
        target = callee(self.code, i)

        def run(s: State) -> int:
            if isinstance(target, tuple):
                bound = self._call(target)
                self._called_apart |= bound.apart
                self._foreign |= bound.foreign
                self._code |= bound.code
                after_call(s, self._function(target).written, bound.written)
                return bound.instructions
            if target == "" or target in self.apart:
                self._called_apart.add(target or "the host")
                after_call(s)
                return 0
            self._foreign.add(target)
            size = s.registers[2]
            try:
                known = size[1] if size is not None and size[0] == "" else None
                cost = self.price(target, known) if self.price is not None else 0
            except Missing as error:
                raise Unbounded(str(error)) from None
            after_call(s)
            return cost

        return run

    def _run(self, f: _Function, region: Region, inflow: Flow) -> Flow:
        """Executes a region. Returns for every target address the known values and the longest path to it."""
        flow = inflow
        for part in region.parts:
            if isinstance(part, Loop):
                turn = {a: flow.pop(a) for a in part.entries if a in flow}
                if turn:
                    self._loop(f, part, turn, flow)
            elif part in flow:
                state, cost = flow.pop(part)
                self._block(f, part, state, cost, flow)
        return flow

    def _loop(self, f: _Function, loop: Loop, turn: Flow, flow: Flow) -> None:
        """Executes a loop iteration by iteration. Adds its exits to `flow`."""
        most = self._most_turns(f, loop)
        made = 0
        while turn and made != most:
            before = {a: state.copy() for a, (state, _) in turn.items()}
            out = self._run(f, loop.body, turn)
            turn = {loop.header: out.pop(loop.header)} if loop.header in out else {}
            for target, (state, cost) in out.items():
                merge(flow, target, state, cost)
            made += 1
            if turn and most is None and before.get(loop.header) == turn[loop.header][0]:
                raise Unbounded(
                    f"the loop at {loop.header[0]}+{loop.header[1]:#x} has no bound that the analysis can prove"
                )

    def _most_turns(self, f: _Function, loop: Loop) -> int | None:
        """Given maximum number of iterations of this loop. None if none is given."""
        limits = self.turns.get(self.code.function_of(loop.header), ()) if self.turns else ()
        found = (
            {i.mnemonic for block in blocks_of(loop.body) for i in f.blocks[block].instructions} if limits else set()
        )
        return next((most for mnemonic, most in limits if not mnemonic or mnemonic in found), None)

    def _block(self, f: _Function, at: Address, state: State, cost: int, flow: Flow) -> None:
        self._blocks_left -= 1
        if self._blocks_left < 0:
            raise Unbounded("its loops have too many iterations to analyse")
        for count, effect in f.steps[at]:
            cost += count + ((effect(state) or 0) if effect is not None else 0)
        block = f.blocks[at]
        self._code[at] = block.bytes
        targets = block.successors or (_RETURN,)
        if block.condition:
            taken = decide(block.condition, state.flags)
            targets = targets if taken is None else ((targets[0],) if taken else (targets[1],))
        elif block.indirect and (known := _jump_target(block, state)) in targets:
            targets = (known,)
        if self.reached is not None and block.successors:
            targets = tuple(t for t in targets if t in self.reached)
        for n, target in enumerate(targets):
            way = state if n == len(targets) - 1 else state.copy()
            for when_taken, write, value in f.lessons.get(at, ()):
                if when_taken == (target == block.successors[0]) and len(set(block.successors)) == 2:
                    write(way, value)
            merge(flow, target, way, cost)


def _repeating(effect: Effect | None) -> Calling:
    """A string instruction counts once for each repetition."""

    def run(s: State) -> int:
        most = greatest(s.registers[NAMES.index("rcx")])
        if most is None:
            raise Unbounded("a repeated string instruction of unknown length")
        if effect is not None:
            effect(s)
        return max(most, 1)

    return run


def _learned(block: Block, decoder: Decoder) -> list[tuple[bool, Callable[[State, Value], None], Value]]:
    last = block.instructions[-1]
    return [
        (when, decoder.writer(last, register, REGISTERS[register[1:]][1]), number(value))
        for when, register, value in lessons(block.instructions)
    ]


def merge(flow: Flow, target: Address, state: State, cost: int) -> None:
    there = flow.get(target)
    flow[target] = (state, cost) if there is None else (there[0].joined(state), max(there[1], cost))


def _jump_target(block: Block, state: State) -> Address:
    operand = block.instructions[-1].operands[0].lstrip("*%")
    value = state.registers[REGISTERS[operand][0]] if operand in REGISTERS else None
    return (str(value[0]), value[1]) if value is not None else ("", 0)


def _may_write(mnemonic: str, operands: tuple[str, ...]) -> set[int]:
    implied = {"mul": (0, 2), "imul": (0, 2), "div": (0, 2), "idiv": (0, 2), "rep": (1, 6, 7)}
    found = {REGISTERS[o[1:]][0] for o in operands if o[1:] in REGISTERS}
    for start, registers in implied.items():
        if mnemonic.startswith(start):
            found |= set(registers)
    return found
