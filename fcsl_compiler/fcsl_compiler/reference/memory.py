# SPDX-License-Identifier: Apache-2.0
"""Values in the flat memory of a machine, by paths of its field table.

A value is a tree of objects (structs, arrays) whose leaves are numbers and words. For each group of values that a
tick moves together, one function is made as text, once: it moves all their leaves with as few calls of `struct` as
possible.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, product
from typing import Any

from .arrays import ArrayType
from .constants import Literals
from .structs import StructType, slot
from .types import SCALARS, Scalar, Type
from .values import INTEGERS

#: Offsets (bytes) of every field by its path (fcsl_machine.h), and of items that the table does not list:
#: `machine.current`, `<instance>.inject_overrun|inject_fault`, `channels.<channel>.attached|fresh|sample_age`.
Layout = Mapping[str, int]
Memory = bytearray | memoryview

HEALTH = ("nominal", "degraded", "failed", "stale")


class Image:
    """A machine's memory, as bytes and as cells of other types."""

    __slots__ = ("bytes", "longs", "memory", "naturals", "words")

    def __init__(self, memory: Memory):
        self.memory, self.bytes = memory, memoryview(memory)
        self.words, self.naturals, self.longs = (self.bytes.cast(code) for code in ("i", "I", "Q"))


@dataclass(frozen=True)
class Leaf:
    """Numbers at one place of the memory. `place`: the expression of the value that has them."""

    offset: int
    type: Scalar
    place: str
    count: int = 0  # of an array's elements; 0 is a scalar

    @property
    def format(self) -> str:
        return f"{self.count or ''}{self.type.code}"

    @property
    def end(self) -> int:
        return self.offset + struct.calcsize(f"={self.format}")


def leaves(type_: Type, place: str, path: str, layout: Layout) -> Iterator[Leaf]:
    """Leaves of a value of a struct, array or scalar type at `path` that is the value of `place`."""
    if isinstance(type_, StructType):
        for name, member in type_.members.items():
            yield from leaves(member, f"{place}.{slot(name)}", f"{path}.{name}", layout)
    elif isinstance(type_, Scalar):
        yield Leaf(layout[path], type_, place)
    elif isinstance(type_, ArrayType) and isinstance(type_.element, Scalar):
        yield Leaf(layout[path], type_.element, place, type_.count)
    else:
        assert isinstance(type_, ArrayType)
        for n, indices in enumerate(product(*map(range, type_.shape))):
            subscript = "".join(f"[{i}]" for i in indices)
            yield from leaves(type_.element, f"{place}.data[{n}]", path + subscript, layout)


class Movers:
    """Makes functions that move values. `requests`: the machine's requests in order."""

    def __init__(self, layout: Layout, requests: Sequence[str]):
        self._starts = sorted(set(layout.values()))
        words = {"Health": HEALTH, "TransitionRequest": ("", *requests)}
        self._names: dict[str, Any] = {f"words_{name}": known for name, known in words.items()}
        self._names |= {f"number_{name}": {word: n for n, word in enumerate(known)} for name, known in words.items()}
        self._names |= {f"of_{name}": scalar.of for name, scalar in SCALARS.items()}

    # ---- from memory to values -------------------------------------------------------------------------------------

    def loader(self, wanted: Iterable[Leaf], given: Mapping[str, Any] | None = None) -> Callable[[Any, Memory], None]:
        """A function that puts leaves into the objects of a tree `s`, several of one offset too, and then assigns
        what is `given`: by place, a value or a function that returns it."""
        found = sorted(wanted, key=lambda leaf: leaf.offset)
        distinct = {leaf.offset: leaf for leaf in found}
        ends = accumulate(leaf.count or 1 for leaf in distinct.values())
        at = dict(zip(distinct, (0, *ends), strict=False))
        names, lines = dict(self._names), list[str]()
        if found:
            names["unpack"] = struct.Struct("=" + self._format(list(distinct.values()))).unpack_from
            lines.append(f"v = unpack(memory, {found[0].offset})")
        lines += [self._put(leaf, at[leaf.offset]) for leaf in found]
        for n, (place, value) in enumerate((given or {}).items()):
            names[f"given{n}"] = value
            lines.append(f"{place} = given{n}{'()' if callable(value) else ''}")
        return _function("load", lines, names)

    def _put(self, leaf: Leaf, at: int) -> str:
        if not leaf.count:
            return f"{leaf.place} = {self._read(leaf.type, f'v[{at}]')}"
        whole = f"v[{at}:{at + leaf.count}]"
        each = self._read(leaf.type, "n")
        if leaf.count <= 4:
            items = [self._read(leaf.type, f"v[{n}]") for n in range(at, at + leaf.count)]
            return f"{leaf.place}.data = [{', '.join(items)}]"
        return f"{leaf.place}.data = {f'[*{whole}]' if each == 'n' else f'[{each} for n in {whole}]'}"

    def _read(self, type_: Scalar, number: str) -> str:
        """The value of a number in memory. Floats and bools are what unpacking returns."""
        if f"words_{type_.name}" in self._names:
            return f"words_{type_.name}[{number}]"
        return number if type_.of in (float, bool) else f"of_{type_.name}({number})"

    # ---- from values to memory -------------------------------------------------------------------------------------

    def storer(self, wanted: Iterable[Leaf]) -> Callable[[Any, Memory], None]:
        """A function that writes leaves of a tree `s`, and nothing between them but padding."""
        names, lines, run = dict(self._names), list[str](), list[Leaf]()
        for leaf in sorted(wanted, key=lambda leaf: leaf.offset):
            if run and self._between(run[-1].end, leaf.offset):
                self._pack(run, lines, names)
                run = []
            run.append(leaf)
        if run:
            self._pack(run, lines, names)
        return _function("store", lines, names)

    def _between(self, end: int, start: int) -> bool:
        """Whether something else lies between two leaves."""
        return any(end <= other < start for other in self._starts)

    def _pack(self, run: list[Leaf], lines: list[str], names: dict[str, Any]) -> None:
        name = f"pack{len(lines)}"
        names[name] = struct.Struct("=" + self._format(run)).pack_into
        lines.append(f"{name}(memory, {run[0].offset}, {', '.join(map(self._written, run))})")

    def _written(self, leaf: Leaf) -> str:
        words = f"number_{leaf.type.name}"
        if not leaf.count:
            return f"{words}[{leaf.place}]" if words in self._names else leaf.place
        return f"*[{words}[n] for n in {leaf.place}.data]" if words in self._names else f"*{leaf.place}.data"

    @staticmethod
    def _format(run: Sequence[Leaf]) -> str:
        """Format of leaves in order of their offsets, with bytes that are left out between them."""
        parts, end = list[str](), run[0].offset
        for leaf in run:
            parts += [f"{leaf.offset - end}x" if leaf.offset > end else "", leaf.format]
            end = leaf.end
        return "".join(parts)


def _function(name: str, lines: list[str], names: dict[str, Any]) -> Callable[[Any, Memory], None]:
    body = "\n".join(f"    {line}" for line in lines or ["pass"])
    exec(f"def {name}(s, memory):\n{body}\n", names)
    function: Callable[[Any, Memory], None] = names[name]
    return function


def from_json(type_: Type, value: Any, literals: Literals, request: Callable[[str], str]) -> Any:
    """Converts a value of the machine JSON: nested lists for arrays, objects for structs, names for healths, expressions of
    constants for numbers, columns of files for vectors. `request`: what the algorithm calls one."""
    if isinstance(type_, StructType):
        return type_.of(
            {name: from_json(member, value[name], literals, request) for name, member in type_.members.items()}
        )
    if isinstance(type_, ArrayType):
        if isinstance(value, dict) and "csv" in value:
            value = literals.column(value["csv"], value["column"], type_.element.name in INTEGERS)
        if not isinstance(value, list):  # a default of every element
            return type_.of([from_json(type_.element, value, literals, request) for _ in range(type_.count)])
        flat = [value]
        for _ in type_.shape:
            flat = [item for row in flat for item in row]
        return type_.of([from_json(type_.element, item, literals, request) for item in flat])
    if type_.name == "TransitionRequest":
        return type_.store(request(value))
    return type_.store(str(value) if type_.name == "Health" else literals.number(value))
