# SPDX-License-Identifier: Apache-2.0
"""Basic blocks and loops of a function, from its machine code."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from .objects import Address, Instruction, NotReadable, ObjectFile


class Unbounded(Exception):
    """A function has no bound. str() gives the reason for users."""


@dataclass
class Block:
    start: Address
    instructions: list[Instruction] = field(default_factory=list)
    successors: tuple[Address, ...] = ()  # the target of a conditional jump, then the next block
    condition: str = ""  # condition of the jump at its end
    indirect: bool = False  # ends with a jump through a table; the successors are all entries of the table

    @property
    def bytes(self) -> int:
        return sum(i.length for i in self.instructions)


@dataclass
class Loop:
    """A strongly connected component of the blocks. Without the edges back to `header`, `body` contains all of it.

    The loop may also be entered at other blocks (gcc threads jumps). Such a path reaches the header, or leaves, within
    its first iteration.
    """

    header: Address
    entries: frozenset[Address]
    body: Region


@dataclass
class Region:
    """Parts in topological order: none leads to an earlier one."""

    parts: list[Address | Loop]


def blocks_of(region: Region) -> Iterator[Address]:
    """All blocks, including those of loops."""
    for part in region.parts:
        if isinstance(part, Loop):
            yield from blocks_of(part.body)
        else:
            yield part


def callee(code: ObjectFile, i: Instruction) -> Address | str:
    """Target of a call or jump: an address of this object, the name of an external function, or "" (through a
    pointer)."""
    if i.operands[0].startswith("*"):
        return ""
    if i.symbol:
        inside = code.address_of(i)
        return inside if inside is not None else i.symbol
    return (i.address[0], int(i.operands[0], 16))


def blocks_from(code: ObjectFile, entry: Address) -> dict[Address, Block]:
    """Blocks reachable from `entry` without returning. A jump out of the object ends a block, as a call and a return
    do."""
    leaders, pending, ends = {entry}, [entry], {}
    seen: set[Address] = set()
    while pending:
        at = pending.pop()
        if at in seen:
            continue
        while at not in seen:
            seen.add(at)
            i = code.instructions.get(at)
            if i is None:
                raise NotReadable(f"no instruction at {at[0]}+{at[1]:#x}")
            following = (at[0], at[1] + i.length)
            if i.mnemonic.startswith("j"):
                targets = _targets(code, i, entry)
                ends[at] = targets if i.mnemonic == "jmp" else (*targets, following)
                leaders.update(ends[at])
                pending += ends[at]
                break
            if i.mnemonic in ("ret", "hlt", "ud2"):
                ends[at] = ()
                break
            at = following
    return {start: _block(code, start, leaders, ends) for start in leaders}


def _targets(code: ObjectFile, i: Instruction, entry: Address) -> tuple[Address, ...]:
    if not i.operands[0].startswith("*"):
        target = callee(code, i)
        return (target,) if isinstance(target, tuple) else ()
    # All targets within this function of any table of the object: a superset of the targets of this jump.
    end = min((a[1] for a in code.functions.values() if a[0] == entry[0] and a[1] > i.address[1]), default=1 << 62)
    found = set()
    for (section, at), (target_section, addend) in code.tables.items():
        tables = sorted({t for t in _table_starts(code) if t[0] == section and t[1] <= at}, reverse=True)
        if tables:
            target = (target_section, addend - (at - tables[0][1]))
            if target[0] == entry[0] and entry[1] <= target[1] < end and target in code.instructions:
                found.add(target)
    if not found:
        raise Unbounded("a jump through a pointer that is not a jump table")
    return tuple(sorted(found))


def _table_starts(code: ObjectFile) -> set[Address]:
    if code.table_starts is None:
        addresses = (code.address_of(i) for i in code.instructions.values() if i.mnemonic == "lea" and i.symbol)
        code.table_starts = {a for a in addresses if a in code.tables}
    return code.table_starts


def _block(code: ObjectFile, start: Address, leaders: set[Address], ends: dict[Address, tuple[Address, ...]]) -> Block:
    block, at = Block(start), start
    while True:
        i = code.instructions[at]
        block.instructions.append(i)
        if at in ends:
            block.successors = ends[at]
            block.indirect = i.mnemonic == "jmp" and i.operands[0].startswith("*")
            block.condition = i.mnemonic[1:] if i.mnemonic != "jmp" and i.mnemonic.startswith("j") else ""
            return block
        at = (at[0], at[1] + i.length)
        if at in leaders:
            block.successors = (at,)
            return block


def region_of(blocks: dict[Address, Block], entry: Address) -> Region:
    """Nested loops and blocks in topological order."""
    return _region(set(blocks), {entry}, {a: list(b.successors) for a, b in blocks.items()})


def _region(nodes: set[Address], entries: set[Address], successors: dict[Address, list[Address]]) -> Region:
    parts: list[Address | Loop] = []
    for component in reversed(_components(nodes, successors)):
        inside = set(component)
        if len(component) == 1 and component[0] not in successors[component[0]]:
            parts.append(component[0])
            continue
        into = {t for n in nodes - inside for t in successors[n] if t in inside} | (entries & inside)
        header = _header(inside, into, successors)
        inner = _within(inside, header, successors)
        parts.append(Loop(header, frozenset(into), _region(inside, into, inner)))
    return Region(parts)


def _header(inside: set[Address], into: set[Address], successors: dict[Address, list[Address]]) -> Address:
    """Header of a loop. With several entries, preferably a block that every iteration passes."""
    if len(into) > 1:
        for node in sorted(inside):
            if len(_components(inside, _within(inside, node, successors))) == len(inside):
                return node
    return max(sorted(into), key=lambda h: sum(h in successors[n] for n in inside))


def _within(
    inside: set[Address], header: Address, successors: dict[Address, list[Address]]
) -> dict[Address, list[Address]]:
    """Edges within a loop, except those back to its header."""
    return {n: [t for t in successors[n] if t in inside and t != header] for n in inside}


def _components(nodes: set[Address], successors: dict[Address, list[Address]]) -> list[list[Address]]:
    """Strongly connected components (Tarjan, not recursive), each after its successors."""
    index: dict[Address, int] = {}
    low: dict[Address, int] = {}
    stack: list[Address] = []
    waiting: set[Address] = set()
    found: list[list[Address]] = []
    for root in sorted(nodes):
        nothing: Iterator[Address] = iter(())
        work = [(root, nothing)] if root not in index else []
        while work:
            node, rest = work[-1]
            if node not in index:
                index[node] = low[node] = len(index)
                stack.append(node)
                waiting.add(node)
                rest = iter([t for t in successors[node] if t in nodes])
                work[-1] = (node, rest)
            for target in rest:
                if target not in index:
                    work.append((target, nothing))
                    break
                if target in waiting:
                    low[node] = min(low[node], index[target])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    at = stack.index(node)
                    found.append(stack[at:])
                    waiting.difference_update(stack[at:])
                    del stack[at:]
    return found
