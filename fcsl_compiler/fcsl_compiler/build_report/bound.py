# SPDX-License-Identifier: Apache-2.0
"""The most instructions that a call of a function can execute: the longest path through its machine code.

The code is executed on what is known (values.py): a branch whose condition is known goes one way, any other both ways,
and where ways meet, only what holds on both stays known and the longer way counts. A loop is executed turn by turn until
no way leads back to its start; counters and pointers of compiled `for` loops are known on every turn, so this ends when
the loop does. Nothing is estimated: where a loop does not end on what is known, there is no bound.
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
from .values import CALLER_SAVED, NAMES, Cell, State, Value, decide, number

#: Blocks that one bound may execute; beyond, it is given up (some seconds).
_MOST_BLOCKS = 200_000
#: Where ways end that leave the function.
_RETURN: Address = ("return", 0)

#: Executes something and returns what that costs besides the instruction itself.
Calling = Callable[[State], int]
#: Instructions, and what the last of them does.
Step = tuple[int, Callable[[State], int | None] | None]
#: What is known on entry, by place: bytes and value.
Memory = dict[Cell, tuple[int, Value]]
Flow = dict[Address, tuple[State, int]]


@dataclass(frozen=True)
class Bound:
    """Instructions of one call, those of what it calls in its own object included; `apart` names what is called and not
    counted, `foreign` what is called and has a price, `code` are the blocks that it can reach, with their bytes."""

    instructions: int
    code: dict[Address, int]
    apart: frozenset[str]
    foreign: frozenset[str]
    written: frozenset[tuple[object, int, int]]  # stores to places that are told from the registers on entry


@dataclass
class _Function:
    region: Region
    steps: dict[Address, list[Step]]
    blocks: dict[Address, Block]
    lessons: dict[Address, list[tuple[bool, Callable[[State, Value], None], Value]]]
    written: frozenset[int]


class Bounder:
    """Bounds of the functions of one object. `apart`: functions whose cost is somebody else's, such as externs. `price`: what
    a call of fcsl_math, libm and libc counts; without it, nothing. `turns`: for loops that do not end on what is known, by
    function, (a mnemonic that the loop has, the most turns that it makes, the one that leaves it included); the first that fits."""

    def __init__(
        self,
        code: ObjectFile,
        apart: frozenset[str] = frozenset(),
        price: Price | None = None,
        turns: Mapping[str, tuple[tuple[str, int], ...]] | None = None,
    ):
        self.code, self.apart, self.price, self.turns = code, apart, price, turns or {}
        self.reached: frozenset[Address] | None = None  # no way leads elsewhere; None: every way counts
        self._functions: dict[Address, _Function] = {}
        self._known: dict[Address, Bound] = {}
        self._active: list[Address] = []
        self._blocks_left = 0
        self._called_apart: set[str] = set()
        self._foreign: set[str] = set()
        self._code: dict[Address, int] = {}

    def of(self, function: str, memory: Memory | None = None) -> Bound:
        """Of a call with any arguments, with `memory` known on entry: scalars that stand alone, in no array. Raises Unbounded,
        NotReadable."""
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
        """Instructions that change nothing that is tracked count with the next one that does."""
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
        """Registers that a call may leave changed: gcc knows those of its own functions and relies on it."""
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
        """What leaves a region: for every address that it leads to, what is known there and the longest way so far."""
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
        """Turn by turn; what leaves the loop goes into `flow`."""
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
                raise Unbounded(f"the loop at {loop.header[0]}+{loop.header[1]:#x} does not end on what is known of it")

    def _most_turns(self, f: _Function, loop: Loop) -> int | None:
        """What is told of this loop. None: nothing."""
        told = self.turns.get(self.code.function_of(loop.header), ()) if self.turns else ()
        found = {i.mnemonic for block in blocks_of(loop.body) for i in f.blocks[block].instructions} if told else set()
        return next((most for mnemonic, most in told if not mnemonic or mnemonic in found), None)

    def _block(self, f: _Function, at: Address, state: State, cost: int, flow: Flow) -> None:
        self._blocks_left -= 1
        if self._blocks_left < 0:
            raise Unbounded("its loops turn too often to be counted")
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
        turns = s.registers[NAMES.index("rcx")]
        if turns is None or turns[0] != "":
            raise Unbounded("a repeated string instruction of unknown length")
        if effect is not None:
            effect(s)
        return max(turns[1], 1)

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
