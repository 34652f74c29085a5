# SPDX-License-Identifier: Apache-2.0
"""Programs as trees. Every expression carries the type it has by construction; str() is its text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .types import FLOATS, Array, Struct, Type, row


@dataclass(frozen=True)
class Expr:
    type: Type

    def __str__(self) -> str:
        raise NotImplementedError


@dataclass(frozen=True)
class Literal(Expr):
    """A number, or a bool. `name` is what stands for it: a constant's name, pi, inf; bare ones adopt their type."""

    value: Any
    bare: bool = True
    name: str = ""

    def __str__(self) -> str:
        if self.type == "bool":
            return str(self.value)
        text = self.name or number_text(self.value)
        return text if self.bare else f"{self.type}({text})"


def number_text(value: int | float) -> str:
    text = repr(value)
    return {"inf": "inf", "-inf": "-inf", "nan": "nan"}.get(text, text)


@dataclass(frozen=True)
class Word(Expr):
    """Health.degraded, TransitionRequest.GO."""

    word: str

    def __str__(self) -> str:
        return f"{self.type}.{self.word}"


@dataclass(frozen=True)
class Name(Expr):
    """A local, an argument, a typed constant (`constant`)."""

    name: str
    constant: bool = False

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class LoopVar(Expr):
    """A loop variable as a value of `type`, which it converts to by itself (i64, or any that its bounds fit)."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Field(Expr):
    """u.a, y.r: `record` is inputs, parameters, outputs or state."""

    record: str
    name: str

    def __str__(self) -> str:
        return f"{RECORD_ARGUMENT[self.record]}.{self.name}"


RECORD_ARGUMENT = {"inputs": "u", "parameters": "p", "outputs": "y", "state": "x"}
RECORD_CLASS = {"inputs": "Inputs", "parameters": "Parameters", "outputs": "Outputs", "state": "State"}


@dataclass(frozen=True)
class Slice:
    """low:high of an extent; None where the text leaves a bound out."""

    low: int | None
    high: int | None

    def __str__(self) -> str:
        return f"{'' if self.low is None else self.low}:{'' if self.high is None else self.high}"

    def bounds(self, extent: int) -> tuple[int, int]:
        return slice(self.low, self.high).indices(extent)[:2]


@dataclass(frozen=True)
class Index(Expr):
    """base[i, j]; with `apart` base[i][j]."""

    base: Expr
    indices: tuple[Expr | Slice, ...]
    apart: bool = False

    def __str__(self) -> str:
        if self.apart:
            return str(self.base) + "".join(f"[{i}]" for i in self.indices)
        return f"{self.base}[{', '.join(map(str, self.indices))}]"


@dataclass(frozen=True)
class Member(Expr):
    base: Expr
    name: str

    def __str__(self) -> str:
        return f"{self.base}.{self.name}"


@dataclass(frozen=True)
class Unary(Expr):
    """- ~ not; of arrays - element by element."""

    op: str
    a: Expr

    def __str__(self) -> str:
        return f"({self.op}{' ' if self.op == 'not' else ''}{self.a})"


@dataclass(frozen=True)
class Binary(Expr):
    """One arithmetic operation, element by element where an operand is an array."""

    op: str
    a: Expr
    b: Expr

    def __str__(self) -> str:
        return f"({self.a} {self.op} {self.b})"


@dataclass(frozen=True)
class Compare(Expr):
    """a < b <= c: operands of one type."""

    ops: tuple[str, ...]
    operands: tuple[Expr, ...]

    def __str__(self) -> str:
        rest = (f" {op} {e}" for op, e in zip(self.ops, self.operands[1:], strict=True))
        return f"({self.operands[0]}{''.join(rest)})"


@dataclass(frozen=True)
class Logic(Expr):
    op: str
    operands: tuple[Expr, ...]

    def __str__(self) -> str:
        return f"({f' {self.op} '.join(map(str, self.operands))})"


@dataclass(frozen=True)
class Choose(Expr):
    condition: Expr
    then: Expr
    otherwise: Expr

    def __str__(self) -> str:
        return f"({self.then} if {self.condition} else {self.otherwise})"


@dataclass(frozen=True)
class Call(Expr):
    """A builtin, a conversion, a library function or (with `helper`) a function of the file."""

    name: str
    args: tuple[Expr, ...]
    helper: Function | None = None

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(str, self.args))})"


@dataclass(frozen=True)
class ArrayOf(Expr):
    items: tuple[Expr, ...]

    def __str__(self) -> str:
        return f"[{', '.join(map(str, self.items))}]"


@dataclass(frozen=True)
class StructOf(Expr):
    """Pose(a, b) or Pose(x=a, y=b); `order` is that of the text."""

    args: tuple[tuple[str, Expr], ...]
    keywords: bool

    def __str__(self) -> str:
        texts = (f"{n}={e}" if self.keywords else str(e) for n, e in self.args)
        return f"{self.type}({', '.join(texts)})"


# ---- statements ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Assign:
    """target = value; `declared` writes its type, `op` makes it target op= value."""

    target: Expr
    value: Expr
    op: str = ""
    declared: bool = False

    def lines(self) -> Iterator[str]:
        note = f": {annotation(self.target.type)}" if self.declared else ""
        yield f"{self.target}{note} {self.op}= {self.value}"


@dataclass(frozen=True)
class Unpack:
    """a, b = c, d; or a, b = array (one value)."""

    targets: tuple[Expr, ...]
    values: tuple[Expr, ...]

    def lines(self) -> Iterator[str]:
        yield f"{', '.join(map(str, self.targets))} = {', '.join(map(str, self.values))}"


@dataclass(frozen=True)
class Perform:
    """A call whose effect is all that is wanted."""

    call: Call

    def lines(self) -> Iterator[str]:
        yield str(self.call)


@dataclass(frozen=True)
class If:
    """if / elif … / else: conditions with their blocks; the last block has none when there is an else."""

    branches: tuple[tuple[Expr | None, Block], ...]

    def lines(self) -> Iterator[str]:
        for n, (condition, block) in enumerate(self.branches):
            yield "else:" if condition is None else f"{'elif' if n else 'if'} {condition}:"
            yield from indented(block)


@dataclass(frozen=True)
class For:
    variable: str
    args: tuple[Expr, ...]  # of range
    block: Block

    def lines(self) -> Iterator[str]:
        yield f"for {self.variable} in range({', '.join(map(str, self.args))}):"
        yield from indented(self.block)


@dataclass(frozen=True)
class Jump:
    """break, continue, pass, or (with a value) return."""

    word: str
    value: Expr | None = None

    def lines(self) -> Iterator[str]:
        yield self.word if self.value is None else f"{self.word} {self.value}"


Stmt = Assign | Unpack | Perform | If | For | Jump
Block = tuple[Stmt, ...]


def indented(block: Block) -> Iterator[str]:
    for statement in block or (Jump("pass"),):
        for line in statement.lines():
            yield "    " + line


def annotation(type_: Type) -> str:
    return f'"{type_}"' if isinstance(type_, Array | Struct) else type_


# ---- files ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Function:
    """A helper; or execute and start, whose arguments are records and whose result is None."""

    name: str
    arguments: tuple[tuple[str, Type], ...]
    result: Type | None
    block: Block
    records: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        written = [f"{n}: {annotation(t)}" for n, t in self.arguments]
        written += [f"{RECORD_ARGUMENT[r]}: {RECORD_CLASS[r]}" for r in self.records]
        result = "None" if self.result is None else annotation(self.result)
        yield f"def {self.name}({', '.join(written)}) -> {result}:"
        yield from indented(self.block)


@dataclass(frozen=True)
class Constant:
    """NAME = value; with a type of its own when `declared`. Bare scalars are Literals wherever they are used."""

    name: str
    type: Type
    value: Any
    declared: bool
    made_of: Expr | None = None  # what the value was folded from

    def line(self) -> str:
        note = f": {annotation(self.type)}" if self.declared else ""
        return f"{self.name}{note} = {self.made_of or constant_text(self.type, self.value)}"


def constant_text(type_: Type, value: Any) -> str:
    if isinstance(type_, Array):
        return f"[{', '.join(constant_text(row(type_), v) for v in value)}]"
    if isinstance(type_, Struct):
        return f"{type_}({', '.join(constant_text(k, value[n]) for n, k in type_.members)})"
    return number_text(value)


@dataclass(frozen=True)
class Algorithm:
    name: str
    ports: dict[str, tuple[tuple[str, Type], ...]]  # by record
    constants: tuple[Constant, ...]
    helpers: tuple[Function, ...]
    execute: Function
    start: Function | None = None

    def text(self) -> str:
        out: list[str] = [c.line() for c in self.constants]
        for record, ports in self.ports.items():
            if ports:
                out += ["", "", f"class {RECORD_CLASS[record]}:"]
                out += [f"    {n}: {self._sized(t)}" for n, t in ports]
        for function in (*self.helpers, *([self.start] if self.start else []), self.execute):
            out += ["", "", *function.lines()]
        return "\n".join(out).lstrip("\n") + "\n"

    def _sized(self, type_: Type) -> str:
        """A port's type; an extent is written by the name of a constant where one has its value."""
        names = {c.value: c.name for c in self.constants if c.type == "i64" and not c.declared}
        if not isinstance(type_, Array):
            return annotation(type_)
        return f'"{type_.element}[{", ".join(names.get(n) or str(n) for n in type_.shape)}]"'


def walk(block: Block) -> Iterator[Stmt]:
    for statement in block:
        yield statement
        if isinstance(statement, If):
            for _, inner in statement.branches:
                yield from walk(inner)
        elif isinstance(statement, For):
            yield from walk(statement.block)


def root(place: Expr) -> Expr:
    """The local or field that an assignable expression lies in."""
    while isinstance(place, Index | Member):
        place = place.base
    return place


def is_float(type_: Type) -> bool:
    return type_ in FLOATS
