# SPDX-License-Identifier: Apache-2.0
"""Programs as trees. Every expression has a type by construction. str() is its source text."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .types import FLOATS, Array, Results, Struct, Type, row


@dataclass(frozen=True)
class Expr:
    type: Type

    def __str__(self) -> str:
        raise NotImplementedError


@dataclass(frozen=True)
class Literal(Expr):
    """A number or bool. `name`: its name in the source: a constant, pi, inf. An untyped literal adopts a type."""

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
    """The name of a health or a request, "" for none. `name`: a constant that holds it."""

    word: str
    name: str = ""

    def __str__(self) -> str:
        return self.name or json.dumps(self.word)


@dataclass(frozen=True)
class Name(Expr):
    """A local, an argument, a typed constant (`constant`)."""

    name: str
    constant: bool = False

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class LoopVar(Expr):
    """A loop variable as a value of `type`, by implicit conversion (i64, or any type that its bounds fit)."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Field(Expr):
    """self.a: `record` is inputs, parameters, outputs or state."""

    record: str
    name: str

    def __str__(self) -> str:
        return f"self.{self.name}"


@dataclass(frozen=True)
class Slice:
    """low:high of a dimension. None for an omitted bound."""

    low: int | None
    high: int | None

    def __str__(self) -> str:
        return f"{'' if self.low is None else self.low}:{'' if self.high is None else self.high}"

    def bounds(self, extent: int) -> tuple[int, int]:
        return slice(self.low, self.high).indices(extent)[:2]


@dataclass(frozen=True)
class Index(Expr):
    """base[i, j]; if `apart`, base[i][j]."""

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
    """- ~ not. For arrays, - is element by element."""

    op: str
    a: Expr

    def __str__(self) -> str:
        return f"({self.op}{' ' if self.op == 'not' else ''}{self.a})"


@dataclass(frozen=True)
class Binary(Expr):
    """One arithmetic operation, element by element if an operand is an array."""

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
    """A builtin, a conversion, a library function, a function of a file (if `helper`), or an extern."""

    name: str
    args: tuple[Expr, ...]
    helper: Function | None = None
    extern: Extern | None = None

    def __str__(self) -> str:
        return f"{self.name}({', '.join(map(str, self.args))})"


@dataclass(frozen=True)
class ArrayOf(Expr):
    items: tuple[Expr, ...]

    def __str__(self) -> str:
        return f"[{', '.join(map(str, self.items))}]"


@dataclass(frozen=True)
class StructOf(Expr):
    """Pose(a, b) or Pose(x=a, y=b). `order`: order in the text."""

    args: tuple[tuple[str, Expr], ...]
    keywords: bool

    def __str__(self) -> str:
        texts = (f"{n}={e}" if self.keywords else str(e) for n, e in self.args)
        return f"{self.type}({', '.join(texts)})"


@dataclass(frozen=True)
class ResultsOf(Expr):
    """a, b after `return`."""

    items: tuple[Expr, ...]

    def __str__(self) -> str:
        return ", ".join(map(str, self.items))


# ---- statements ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Assign:
    """target = value. `declared`: with its type (`quoted`: as a string). `op`: target op= value."""

    target: Expr
    value: Expr
    op: str = ""
    declared: bool = False
    quoted: bool = True

    def lines(self) -> Iterator[str]:
        note = f": {annotation(self.target.type, self.quoted)}" if self.declared else ""
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
    """A call made for its effect."""

    call: Call

    def lines(self) -> Iterator[str]:
        yield str(self.call)


@dataclass(frozen=True)
class Event:
    """event(text, …)"""

    text: str
    values: tuple[Expr, ...]
    severity: str  # "": not written

    def lines(self) -> Iterator[str]:
        parts = [f'"{self.text}"', *map(str, self.values)]
        parts += [f'severity="{self.severity}"'] if self.severity else []
        yield f"event({', '.join(parts)})"


@dataclass(frozen=True)
class If:
    """if / elif … / else: conditions with their blocks. With an else, the last block has no condition."""

    branches: tuple[tuple[Expr | None, Block], ...]

    def lines(self) -> Iterator[str]:
        for n, (condition, block) in enumerate(self.branches):
            yield "else:" if condition is None else f"{'elif' if n else 'if'} {condition}:"
            yield from indented(block)


@dataclass(frozen=True)
class For:
    variable: str
    args: tuple[Expr, ...]  # arguments of range
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


Stmt = Assign | Unpack | Perform | Event | If | For | Jump
Block = tuple[Stmt, ...]


def indented(block: Block) -> Iterator[str]:
    for statement in block or (Jump("pass"),):
        for line in statement.lines():
            yield "    " + line


def annotation(type_: Type, quoted: bool = True) -> str:
    return f'"{type_}"' if quoted and isinstance(type_, Array | Struct) else str(type_)


# ---- files ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Function:
    """A helper; or execute or start, without arguments and result. `constants`: constants of its file that it can
    use."""

    name: str
    arguments: tuple[tuple[str, Type], ...]
    result: Type | None
    block: Block
    constants: tuple[Constant, ...] = ()
    quoted: bool = True  # types of arrays and structs as strings

    def lines(self) -> Iterator[str]:
        assert self.result is not None
        written = [f"{n}: {self._annotation(t)}" for n, t in self.arguments]
        yield f"def {self.name}({', '.join(written)}) -> {self._annotation(self.result)}:"
        yield from indented(self.block)

    def _annotation(self, type_: Type) -> str:
        if isinstance(type_, Results):
            return f"tuple[{', '.join(map(self._annotation, type_.types))}]"
        text = sized(type_, self.constants)
        return f'"{text}"' if self.quoted and not isinstance(type_, str) else text


#: Prefix of extern names. Names in C are global, so the second part is replaced by the name of the case's machine.
EXTERN = "outside_"
EXTERN_CASE = f"{EXTERN}CASE"


@dataclass(frozen=True)
class Extern:
    """A C function. Without a result it is called for its effect."""

    number: int
    arguments: tuple[tuple[str, Type], ...]
    result: Type | None
    quoted: bool = True

    @property
    def name(self) -> str:
        return f"{EXTERN_CASE}_{self.number}"

    def lines(self) -> Iterator[str]:
        written = [f"{n}: {annotation(t, self.quoted)}" for n, t in self.arguments]
        result = "None" if self.result is None else annotation(self.result, self.quoted)
        yield f'@extern(header="{EXTERN_CASE}.h")'
        yield f"def {self.name}({', '.join(written)}) -> {result}: ..."


@dataclass(frozen=True)
class Constant:
    """NAME = value, with a type if `declared`. Untyped scalars are Literals where they are used."""

    name: str
    type: Type
    value: Any
    declared: bool
    made_of: Expr | None = None  # the expression that was folded to the value

    def line(self) -> str:
        note = f": {annotation(self.type)}" if self.declared else ""
        return f"{self.name}{note} = {self.made_of or constant_text(self.type, self.value)}"


def constant_text(type_: Type, value: Any) -> str:
    if isinstance(type_, Array):
        return f"[{', '.join(constant_text(row(type_), v) for v in value)}]"
    if isinstance(type_, Struct):
        return f"{type_}({', '.join(constant_text(k, value[n]) for n, k in type_.members)})"
    return json.dumps(value) if isinstance(value, str) else number_text(value)


@dataclass(frozen=True)
class Look:
    """Formatting of a class without effect on its meaning."""

    records: tuple[str, ...] = ("inputs", "outputs", "parameters", "state")  # order in the text
    annotated: str = ""  # type annotation of the dictionaries
    empty: bool = False  # also writes empty dictionaries
    arrow: bool = False  # writes `-> None`
    documented: bool = False
    methods_first: bool = False


@dataclass(frozen=True)
class Algorithm:
    """A class. `constants`: module constants that its methods can use. `requests`: it declares transition_request."""

    name: str
    ports: dict[str, tuple[tuple[str, Type], ...]]  # by record, without health and transition_request
    constants: tuple[Constant, ...]
    execute: Function
    start: Function | None = None
    requests: bool = False
    look: Look = Look()

    def lines(self) -> Iterator[str]:
        yield f"class {self.name}:"
        if self.look.documented:
            yield '    """What stands here means nothing: inputs = {}."""'
        parts = [self._dictionaries(), self._methods()]
        for part in reversed(parts) if self.look.methods_first else parts:
            yield from (f"    {line}" if line else "" for line in part)

    def _dictionaries(self) -> Iterator[str]:
        for record in self.look.records:
            ports = [(n, sized(t, self.constants)) for n, t in self.ports[record]]
            if record == "outputs" and self.requests:
                ports.insert(len(ports) // 2, ("transition_request", "TransitionRequest"))
            head = f"{record}{self.look.annotated and ': ' + self.look.annotated} ="
            if len(ports) == 1:
                yield f'{head} {{"{ports[0][0]}": "{ports[0][1]}"}}'
            elif ports or self.look.empty:
                entries = [f'    "{n}": "{text}",' for n, text in ports]
                yield from (f"{head} {{", *entries, "}")

    def _methods(self) -> Iterator[str]:
        for function in (self.start, self.execute):
            if function is not None:
                yield ""
                yield f"def {function.name}(self){' -> None' if self.look.arrow else ''}:"
                yield from indented(function.block)


def sized(type_: Type, constants: tuple[Constant, ...]) -> str:
    """A type. A size is written as the name of a constant with its value, if there is one."""
    names = {c.value: c.name for c in constants if c.type == "i64" and not c.declared}
    if not isinstance(type_, Array):
        return str(type_)
    return f"{type_.element}{''.join(f'[{names.get(n) or n}]' for n in type_.shape)}"


@dataclass(frozen=True)
class File:
    """One algorithm file: its imports by module, and its definitions. `path`: relative to the machine JSON."""

    path: str
    imports: tuple[tuple[str, tuple[str, ...]], ...]
    constants: tuple[Constant, ...]
    helpers: tuple[Function, ...]
    classes: tuple[Algorithm, ...]
    for_editors: bool = False  # imports names that the compiler ignores
    externs: tuple[Extern, ...] = ()  # externs that its classes may call

    def text(self) -> str:
        out: list[str] = []
        if self.for_editors:
            out += ["from __future__ import annotations", "", "from fcsl_builtins import clamp, extern, f64, u32", ""]
        out += [f"from {module} import {', '.join(names)}" for module, names in self.imports]
        out += [c.line() for c in self.constants]
        for function in (*self.externs, *self.helpers):
            out += ["", "", *function.lines()]
        for algorithm in self.classes:
            out += ["", "", *algorithm.lines()]
        return "\n".join(out).lstrip("\n") + "\n"


def walk(block: Block) -> Iterator[Stmt]:
    for statement in block:
        yield statement
        if isinstance(statement, If):
            for _, inner in statement.branches:
                yield from walk(inner)
        elif isinstance(statement, For):
            yield from walk(statement.block)


#: Calls that read or write hardware.
HARDWARE = ("hw_read_gpio", "hw_write_gpio", "hw_read_adc", "hw_read_u32", "hw_write_u32")


def parts(e: Expr) -> Iterator[Expr]:
    """An expression and all its subexpressions."""
    yield e
    for value in vars(e).values():
        found = value if isinstance(value, tuple) else (value,)
        for part in found:
            part = part[1] if isinstance(part, tuple) and len(part) == 2 else part  # a member of a struct
            if isinstance(part, Expr):
                yield from parts(part)


def reaches_outside(e: Expr) -> bool:
    return any(isinstance(part, Call) and (part.name in HARDWARE or part.extern) for part in parts(e))


def root(place: Expr) -> Expr:
    """The local or field that contains an assignable expression."""
    while isinstance(place, Index | Member):
        place = place.base
    return place


def is_float(type_: Type) -> bool:
    return type_ in FLOATS
