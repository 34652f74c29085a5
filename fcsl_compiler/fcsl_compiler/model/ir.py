# SPDX-License-Identifier: Apache-2.0
"""The typed intermediate representation: what the checker produces, the verifier checks and the C backend reads.

Expressions are pure. Every implicit rule of the language (literal typing, conversions, index checks) is explicit here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from ..base.source import Span
from .ops import Op
from .ranges import UNBOUNDED, Range
from .types import Array, Struct, Type

# ---- expressions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Const:
    """A scalar. TransitionRequest constants hold the request's name ("" for none), Health constants its number."""

    type: Type
    value: bool | int | float | str
    span: Span


@dataclass(frozen=True)
class Local:
    """A local variable or a helper's argument."""

    type: Type
    name: str
    span: Span


@dataclass(frozen=True)
class RangeVar:
    """The variable of a `for`; its value lies in [low, high]."""

    type: Type
    name: str
    low: int
    high: int
    span: Span


@dataclass(frozen=True)
class Field:
    """`self.name`, a field of one of the records of an instance."""

    type: Type
    record: str
    name: str
    span: Span


@dataclass(frozen=True)
class ModuleConst:
    """A constant with storage of its own: an array of the module, or a frozen parameter. `owner` tells whose it is."""

    type: Type
    owner: str
    name: str
    span: Span


@dataclass(frozen=True)
class Member:
    """`base.name`, a member of a struct."""

    type: Type
    base: Place
    name: str
    span: Span


@dataclass(frozen=True)
class Element:
    """`base[indices]`; fewer indices than dimensions select a sub-array. `checked[i]` says that index i may be out of range."""

    type: Type
    base: Place
    indices: tuple[Expr, ...]
    checked: tuple[bool, ...]
    span: Span


@dataclass(frozen=True)
class Window:
    """The indices [start, start + count) of one dimension."""

    start: int
    count: int


@dataclass(frozen=True)
class Slice:
    """`base[a:b, i, …]`: one subscript per dimension; the windows are the dimensions that stay."""

    type: Array
    base: Place
    subscripts: tuple[Expr | Window, ...]
    checked: tuple[bool, ...]
    span: Span


@dataclass(frozen=True)
class Apply:
    """A scalar operation of the op table. `fault` says whether it can fault for these operands."""

    type: Type
    op: Op
    args: tuple[Expr, ...]
    fault: bool
    span: Span


@dataclass(frozen=True)
class Elementwise:
    """A scalar operation applied element by element; scalar operands are broadcast."""

    type: Array
    op: Op
    args: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True)
class Adjust:
    """`base` with `op` applied to each element and that of a constant array, but for those where the constant is zero. Made by
    lowering; `constant` is there where the elements are too many to be written one by one."""

    type: Array
    op: Op
    base: Expr
    values: tuple[float, ...]
    constant: Expr | None
    span: Span


@dataclass(frozen=True)
class Choose:
    """`then if condition else otherwise`; only the chosen branch is evaluated. `and`, `or` are built on it."""

    type: Type
    condition: Expr
    then: Expr
    otherwise: Expr
    span: Span


@dataclass(frozen=True)
class Let:
    """`body`, in which the local `name` (one that no program can write) is `value`: what is evaluated once and used twice, or has
    parts but no name."""

    type: Type
    name: str
    value: Expr
    body: Expr
    span: Span


@dataclass(frozen=True)
class ArrayValue:
    """All elements of an array, row-major."""

    type: Array
    items: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True)
class StructValue:
    """All members of a struct, in order."""

    type: Struct
    items: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True)
class Call:
    """A call of a helper or library function, by its unique name."""

    type: Type
    function: str
    args: tuple[Expr, ...]
    fault: bool
    span: Span


@dataclass(frozen=True)
class EffectCall:
    """The result of a call that reaches outside the machine, inside an expression: check/hoist.py makes a statement (Effect) of it."""

    type: Type
    function: Extern
    args: tuple[Expr, ...]
    span: Span


#: What has storage; only some of it may be written.
Place = Local | Field | ModuleConst | Member | Element | Slice
Expr = (
    Place
    | Const
    | RangeVar
    | Apply
    | Elementwise
    | Adjust
    | Choose
    | Let
    | ArrayValue
    | StructValue
    | Call
    | EffectCall
)


def root(place: Place) -> Local | Field | ModuleConst:
    """The variable that a place is, or is a part of."""
    while isinstance(place, Member | Element | Slice):
        place = place.base
    return place


def variable(place: Place) -> tuple[str, str]:
    """What tells the variable of a place from every other: its record, or "" for what is local, and its name."""
    found = root(place)
    return (found.record, found.name) if isinstance(found, Field) else ("", found.name)


def variables(e: Expr) -> set[tuple[str, str]]:
    """Every variable that an expression reads."""
    own = {variable(e)} if isinstance(e, Place) else set()
    return own.union(*map(variables, children(e)))


def children(e: Expr) -> tuple[Expr, ...]:
    """The expressions an expression is made of."""
    if isinstance(e, Apply | Elementwise | Call | EffectCall):
        return e.args
    if isinstance(e, Adjust):
        return (e.base,) if e.constant is None else (e.base, e.constant)
    if isinstance(e, Choose):
        return (e.condition, e.then, e.otherwise)
    if isinstance(e, Let):
        return (e.value, e.body)
    if isinstance(e, ArrayValue | StructValue):
        return e.items
    if isinstance(e, Member):
        return (e.base,)
    if isinstance(e, Element):
        return (e.base, *e.indices)
    if isinstance(e, Slice):
        return (e.base, *(s for s in e.subscripts if not isinstance(s, Window)))
    return ()


# ---- statements --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Assign:
    target: Place
    value: Expr
    span: Span


@dataclass(frozen=True)
class If:
    condition: Expr
    then: tuple[Stmt, ...]
    otherwise: tuple[Stmt, ...]
    span: Span


@dataclass(frozen=True)
class For:
    variable: str
    start: Expr
    stop: Expr
    step: int
    body: tuple[Stmt, ...]
    span: Span


@dataclass(frozen=True)
class Break:
    span: Span


@dataclass(frozen=True)
class Continue:
    span: Span


@dataclass(frozen=True)
class Return:
    value: Expr | None
    span: Span


@dataclass(frozen=True)
class Extern:
    """A C function that the user declares: scalars by value, arrays and structs behind pointers, so also such a result."""

    name: str
    header: str
    arguments: tuple[tuple[str, Type], ...]
    result: Type | None
    span: Span


@dataclass(frozen=True)
class Effect:
    """A call that reaches outside the machine: an extern, or a hardware builtin of fcsl_hw.h. Its arguments cannot fault."""

    function: Extern
    args: tuple[Expr, ...]
    target: Place | None  # of the result
    span: Span

    @property
    def is_hardware(self) -> bool:
        return self.function.header == HARDWARE_HEADER


#: Header of the hardware builtins; their C functions get the host first.
HARDWARE_HEADER = "fcsl/fcsl_hw.h"

Stmt = Assign | Effect | If | For | Break | Continue | Return


def walk(statements: tuple[Stmt, ...]) -> Iterator[Stmt]:
    """Every statement of a body, inner ones too, in source order."""
    for s in statements:
        yield s
        if isinstance(s, If):
            yield from walk(s.then)
            yield from walk(s.otherwise)
        elif isinstance(s, For):
            yield from walk(s.body)


def expressions(s: Stmt) -> tuple[Expr, ...]:
    """What one statement evaluates, without the statements inside it."""
    if isinstance(s, Assign):
        return (s.target, s.value)
    if isinstance(s, Effect):
        return s.args if s.target is None else (*s.args, s.target)
    if isinstance(s, If):
        return (s.condition,)
    if isinstance(s, For):
        return (s.start, s.stop)
    return (s.value,) if isinstance(s, Return) and s.value is not None else ()


#: Parts of an instance, in the order of its memory.
RECORDS = ("inputs", "parameters", "outputs", "state")


def records(body: tuple[Stmt, ...]) -> tuple[str, ...]:
    """The records that a body reads or writes."""
    used = {v[0] for s in walk(body) for e in expressions(s) for v in variables(e)}
    return tuple(r for r in RECORDS if r in used)


def constants(body: tuple[Stmt, ...]) -> set[tuple[str, str]]:
    """(owner, name) of every ModuleConst that a body reads."""

    def read(e: Expr) -> set[tuple[str, str]]:
        own = {(e.owner, e.name)} if isinstance(e, ModuleConst) else set()
        return own.union(*map(read, children(e)))

    return set().union(*(read(e) for s in walk(body) for e in expressions(s)))


def writes(statements: tuple[Stmt, ...]) -> list[tuple[Place, Expr | None, Span]]:
    """Every place a body writes, with the value (None: what an effect gives), in source order."""
    found: list[tuple[Place, Expr | None, Span]] = []
    for s in walk(statements):
        if isinstance(s, Assign):
            found.append((s.target, s.value, s.span))
        elif isinstance(s, Effect) and s.target is not None:
            found.append((s.target, None, s.span))
    return found


# ---- functions and algorithms --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Function:
    """`execute`, `start`, a helper, or a library function at fixed sizes."""

    name: str  # unique in the whole machine
    source_name: str  # as written
    arguments: tuple[tuple[str, Type], ...]
    records: tuple[str, ...]  # those that execute or start uses, in the order of RECORDS
    result: Type | None
    locals: tuple[tuple[str, Type], ...]
    body: tuple[Stmt, ...]
    faults: bool
    calls: tuple[str, ...]
    span: Span
    requests: tuple[tuple[str, Span], ...] = ()  # every literal request, at its first use
    loop_parameters: tuple[tuple[str, Span], ...] = ()  # that bound a loop, so that instances freeze them

    @property
    def uses_hardware(self) -> bool:
        return any(isinstance(s, Effect) and s.is_hardware for s in walk(self.body))

    @property
    def returned(self) -> str:
        """The local array that every return hands back, if there is one, or "": it lies in the place of the result."""
        values = [s.value for s in walk(self.body) if isinstance(s, Return)]
        names = {v.name if isinstance(v, Local) and isinstance(v.type, Array) else "" for v in values}
        found = names.pop() if len(names) == 1 else ""
        return found if found in dict(self.locals) else ""


@dataclass(frozen=True)
class Port:
    name: str
    type: Type
    unit: str
    doc: str
    span: Span
    range: Range = UNBOUNDED  # of a parameter


@dataclass(frozen=True)
class Algorithm:
    """One checked class, under the name that the machine JSON gives it."""

    name: str
    source: str  # as the machine JSON names it
    files: tuple[str, ...]  # that, and those it imports from
    doc: str
    ports: dict[str, tuple[Port, ...]]  # inputs, parameters, outputs, state
    execute: Function
    start: Function | None
    requests: tuple[tuple[str, Span], ...] = field(default=())  # every literal, at its first use, in helpers too
    externs: tuple[Extern, ...] = field(default=())  # declared, called or not
    makes_requests: bool = False  # declares transition_request
    complete: bool = True  # False: something in it was reported; it has its ports, and an execute that does nothing

    @property
    def owner(self) -> str:
        """Prefix of its functions, and of its instances' frozen parameters (ModuleConst.owner), in C."""
        return f"alg_{self.name}"

    @property
    def effects(self) -> list[Effect]:
        """What it does outside the machine; an algorithm with any is impure."""
        return [s for s in walk(self.execute.body) if isinstance(s, Effect)]

    def port(self, record: str, name: str) -> Port | None:
        return next((p for p in self.ports[record] if p.name == name), None)
