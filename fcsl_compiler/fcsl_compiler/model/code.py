# SPDX-License-Identifier: Apache-2.0
"""Code: what `emit` makes of a lowered machine and a printer writes as text.

It is a small imperative language with explicit storage, pointers and faults, between typed IR (ir.py) and a language
such as C. Names are identifiers of C (c_names.py); a printer for another language maps them. A *place* has storage: a
variable, what a pointer points to, a member, an element, or a block of elements.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..base.source import Span
from .ops import Op
from .types import Scalar

# ---- types ---------------------------------------------------------------------------------------------------------

#: A byte of the machine struct that a host reads or writes.
U8 = Scalar("u8", "uint8_t", "", "uint8", 1, 0, 255)
#: A state of the machine.
STATE = Scalar("State", "int32_t", "FCSL_STATE", "int32", 4)


@dataclass(frozen=True)
class Named:
    """A record, a struct, or a type of fcsl_machine.h."""

    name: str


@dataclass(frozen=True)
class Block:
    """`count` elements side by side."""

    element: Scalar | Named
    count: int


@dataclass(frozen=True)
class Pointer:
    """To one value, or to a block. `writable`: the pointer may be used to write."""

    target: Type
    writable: bool = False


#: A pointer to a struct that only its receiver knows.
UNTYPED = Pointer(Named("void"), writable=True)

Type = Scalar | Named | Block | Pointer

# ---- expressions ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Literal:
    value: bool | int | float
    type: Scalar


@dataclass(frozen=True)
class Name:
    """A variable, a table, or a constant of an enum."""

    text: str


@dataclass(frozen=True)
class Deref:
    """What a pointer points to."""

    pointer: Expr


@dataclass(frozen=True)
class Member:
    base: Place
    name: str


@dataclass(frozen=True)
class Element:
    """Element of a block."""

    base: Place
    index: Expr


@dataclass(frozen=True)
class Part:
    """A block within a block, from element `start` on."""

    base: Place
    start: Expr
    type: Block


@dataclass(frozen=True)
class Address:
    """Pointer to a place. `block`: to the elements of a block."""

    place: Place
    block: bool = False


@dataclass(frozen=True)
class Operation:
    """An operation of the op table. `places`: numbers of the places of its faults; empty if it cannot fault here.
    `fault`: the pointer that stores the first fault."""

    op: Op
    args: tuple[Expr, ...]
    places: tuple[int, ...] = ()
    fault: Expr | None = None


@dataclass(frozen=True)
class Choice:
    """`then if condition else otherwise`. `and` and `or` are `And` and `Or`."""

    condition: Expr
    then: Expr
    otherwise: Expr


@dataclass(frozen=True)
class And:
    args: tuple[Expr, ...]


@dataclass(frozen=True)
class Or:
    args: tuple[Expr, ...]


@dataclass(frozen=True)
class Not:
    arg: Expr


@dataclass(frozen=True)
class Binary:
    """Arithmetic or a comparison of the machine's own numbers; it cannot fault. Operators are those of C."""

    symbol: str
    left: Expr
    right: Expr


@dataclass(frozen=True)
class Convert:
    """To a scalar type: the value fits, or is reduced modulo 2^n. Or of an untyped pointer."""

    type: Scalar | Pointer
    arg: Expr


@dataclass(frozen=True)
class Sum:
    """Row-major offset: the sum of indices times strides, and a constant."""

    terms: tuple[tuple[Expr, int], ...]
    constant: int = 0


@dataclass(frozen=True)
class CheckedIndex:
    """The index if it is in [0, extent), else a fault and 0. `is_u64`: its type is u64."""

    index: Expr
    extent: int
    place: int
    fault: Expr
    is_u64: bool = False


@dataclass(frozen=True)
class Call:
    """A function by its name, or by a place that holds a pointer to it."""

    function: str | Place
    args: tuple[Expr, ...]


@dataclass(frozen=True)
class Null:
    """The null pointer."""


Place = Name | Deref | Member | Element | Part
Expr = (
    Place
    | Literal
    | Address
    | Operation
    | Choice
    | And
    | Or
    | Not
    | Binary
    | Convert
    | Sum
    | CheckedIndex
    | Call
    | Null
)


#: The direct parts of an expression, by its class. A table, because large machines ask it millions of times.
_PARTS: dict[type, Callable[[Any], tuple[Expr, ...]]] = {
    Deref: lambda e: (e.pointer,),
    Member: lambda e: (e.base,),
    Element: lambda e: (e.base, e.index),
    Part: lambda e: (e.base, e.start),
    Address: lambda e: (e.place,),
    Operation: lambda e: e.args if e.fault is None else (*e.args, e.fault),
    Choice: lambda e: (e.condition, e.then, e.otherwise),
    And: lambda e: e.args,
    Or: lambda e: e.args,
    Not: lambda e: (e.arg,),
    Convert: lambda e: (e.arg,),
    Binary: lambda e: (e.left, e.right),
    Sum: lambda e: tuple(term for term, _ in e.terms),
    CheckedIndex: lambda e: (e.index, e.fault),
    Call: lambda e: e.args if isinstance(e.function, str) else (e.function, *e.args),
}


def children(e: Expr) -> tuple[Expr, ...]:
    """The direct parts of an expression."""
    found = _PARTS.get(type(e))
    return found(e) if found is not None else ()


def names(e: Expr) -> list[str]:
    """The names in an expression."""
    found, rest = [], [e]
    while rest:
        part = rest.pop()
        if isinstance(part, Name):
            found.append(part.text)
        else:
            rest += children(part)
    return found


# ---- statements ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class At:
    """The following statements come from this line of the source, until the next one. `quoted`: printers show the
    line."""

    span: Span | None
    quoted: bool = True


@dataclass(frozen=True)
class Let:
    """A variable that keeps this value."""

    name: str
    type: Type
    value: Expr


@dataclass(frozen=True)
class Var:
    """A variable. `value` None: zero if `zeroed`, else undefined until it is assigned."""

    name: str
    type: Type
    value: Expr | None = None
    zeroed: bool = True
    comment: str = ""


@dataclass(frozen=True)
class Table:
    """A constant block or struct, once per library. `values`: nested in the order of the type."""

    name: str
    type: Type
    values: Values


@dataclass(frozen=True)
class Set:
    """`place` gets the value. `volatile`: another thread reads it meanwhile."""

    place: Place
    value: Expr
    volatile: bool = False


@dataclass(frozen=True)
class Update:
    """`place` becomes `place symbol value`, such as a counter."""

    place: Place
    symbol: str
    value: Expr


@dataclass(frozen=True)
class Copy:
    """Copies a block."""

    to: Place
    source: Place
    type: Block


@dataclass(frozen=True)
class Clear:
    """Sets all bits of a block or a record to zero."""

    place: Place
    type: Type


@dataclass(frozen=True)
class Do:
    """A call. `unused`: its result is not needed."""

    call: Call
    unused: bool = False


@dataclass(frozen=True)
class Unused:
    """A variable or argument that nothing reads."""

    name: str


@dataclass(frozen=True)
class If:
    condition: Expr
    then: Body
    otherwise: Body = ()


@dataclass(frozen=True)
class Select:
    """Runs the body of the first constant that equals the value; nothing if none does."""

    value: Expr
    cases: tuple[tuple[Name, Body], ...]


@dataclass(frozen=True)
class Count:
    """Runs the body for name = 0, 1, … count - 1. `unroll`: number of iterations that the compiler should write out."""

    name: str
    count: int
    body: Body
    unroll: int = 0


@dataclass(frozen=True)
class For:
    """Runs the body for name = start, start + step, … before stop; i64."""

    name: str
    start: Expr
    stop: Expr
    step: int
    body: Body
    unroll: int = 0


@dataclass(frozen=True)
class Scope:
    """Variables of the body are visible in it alone."""

    body: Body


@dataclass(frozen=True)
class Return:
    value: Expr | None = None


@dataclass(frozen=True)
class Break:
    pass


@dataclass(frozen=True)
class Continue:
    pass


Statement = (
    At
    | Let
    | Var
    | Table
    | Set
    | Update
    | Copy
    | Clear
    | Do
    | Unused
    | If
    | Select
    | Count
    | For
    | Scope
    | Return
    | Break
    | Continue
)
Body = tuple[Statement, ...]


def parts(s: Statement) -> tuple[tuple[Expr, ...], tuple[Body, ...]]:
    """The expressions of one statement, and its nested bodies."""
    if isinstance(s, Let):
        return (s.value,), ()
    if isinstance(s, Var):
        return ((), ()) if s.value is None else ((s.value,), ())
    if isinstance(s, Set | Update):
        return (s.place, s.value), ()
    if isinstance(s, Copy):
        return (s.to, s.source), ()
    if isinstance(s, Clear):
        return (s.place,), ()
    if isinstance(s, Do):
        return (s.call,), ()
    if isinstance(s, If):
        return (s.condition,), (s.then, s.otherwise)
    if isinstance(s, Select):
        return (s.value,), tuple(body for _, body in s.cases)
    if isinstance(s, Count | Scope):
        return (), (s.body,)
    if isinstance(s, For):
        return (s.start, s.stop), (s.body,)
    if isinstance(s, Return) and s.value is not None:
        return (s.value,), ()
    return (), ()


def used_names(body: Sequence[Statement]) -> set[str]:
    """The names in all expressions of a body."""
    found: set[str] = set()
    for s in body:
        expressions, bodies = parts(s)
        found.update(*map(names, expressions), *map(used_names, bodies))
    return found


def used_functions(body: Sequence[Statement]) -> set[str]:
    """The functions that a body calls."""
    found: set[str] = set()

    def visit(e: Expr) -> None:
        if isinstance(e, Call) and isinstance(e.function, str):
            found.add(e.function)
        for child in children(e):
            visit(child)

    for s in body:
        expressions, bodies = parts(s)
        for e in expressions:
            visit(e)
        found.update(*map(used_functions, bodies))
    return found


# ---- what a machine consists of --------------------------------------------------------------------------------------

#: A literal, or those of the parts.
Values = Literal | Name | tuple["Values", ...]


@dataclass(frozen=True)
class Field:
    """A member of a record. `comment`: one line, or ""."""

    name: str
    type: Type
    comment: str = ""


@dataclass(frozen=True)
class Record:
    """`like`: an earlier record with these fields, of which this is another name."""

    name: str
    fields: tuple[Field, ...]
    like: str = ""


@dataclass(frozen=True)
class Function:
    """`inline`: "always", "hint", "usual" (as the compiler likes), "never" or "rare" (never, and far from other code).
    `flatten`: its callees are inlined. `exported`: hosts may call it. `in_header`: it is defined in the header, so that
    no compiler spends time on it where nobody calls it."""

    name: str
    parameters: tuple[tuple[str, Type], ...]
    result: Type | None
    body: Body
    comment: str = ""
    inline: str = "usual"
    flatten: bool = False
    exported: bool = False
    in_header: bool = False
    span: Span | None = None


@dataclass(frozen=True)
class Prototype:
    """An extern of the user as the algorithms call it. `header`: of C, or the file in Nim."""

    name: str
    header: str
    parameters: tuple[Type, ...]
    result: Type | None
    span: Span
    language: str


@dataclass(frozen=True)
class Program:
    """All code of a machine. Functions follow those that they call, and records those that they contain."""

    name: str
    source: str  # name of the machine JSON
    states: tuple[str, ...]  # constants, from 0
    requests: tuple[str, ...]  # constants, from 0: no request
    records: tuple[Record, ...]  # users may access them
    private_records: tuple[Record, ...]
    externs: tuple[Prototype, ...]
    tables: tuple[Table, ...]
    functions: tuple[Function, ...]
    uses_hardware: bool
    has_events: bool
    stack_bytes: int  # about how much a step needs

    @property
    def headers(self) -> list[str]:
        """Those of its externs in C."""
        return list(dict.fromkeys(e.header for e in self.externs if e.language == "c"))
