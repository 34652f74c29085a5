# SPDX-License-Identifier: Apache-2.0
"""The typed intermediate representation. The checker produces it, the verifier checks it, the C backend reads it.

Expressions are pure. Every implicit rule of the language (types of literals, conversions, index checks) is explicit in
it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ..base.source import Span
from .ops import Op
from .ranges import UNBOUNDED, Range
from .types import Array, Struct, Type

# ---- expressions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Const:
    """A scalar. A TransitionRequest constant holds the request's name ("" for none), a Health constant its number."""

    type: Type
    value: bool | int | float | str
    span: Span


@dataclass(frozen=True)
class Local:
    """A local variable or a helper's argument. `bounds`: of an integer that is assigned in one place."""

    type: Type
    name: str
    span: Span
    bounds: tuple[int, int] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class RangeVar:
    """The variable of a `for`. Its value lies in [low, high]."""

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
    """A constant with storage: an array of a module, or a frozen parameter. `owner` identifies the module or
    instance."""

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
    """`base[indices]`. Fewer indices than dimensions select a sub-array. `checked[i]`: index i may be out of range."""

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
    """`base[a:b, i, …]`: one subscript per dimension. The windows are the dimensions of the result."""

    type: Array
    base: Place
    subscripts: tuple[Expr | Window, ...]
    checked: tuple[bool, ...]
    span: Span


@dataclass(frozen=True)
class Apply:
    """A scalar operation of the op table. `fault`: it can fault for these operands."""

    type: Type
    op: Op
    args: tuple[Expr, ...]
    fault: bool
    span: Span


@dataclass(frozen=True)
class Elementwise:
    """A scalar operation applied element by element. Scalar operands are broadcast."""

    type: Array
    op: Op
    args: tuple[Expr, ...]
    span: Span


@dataclass(frozen=True)
class Adjust:
    """`base` with `op` applied to each element and the corresponding element of a constant array, except where the
    constant is zero. Created by lowering. `constant` is set if there are too many elements to write them out."""

    type: Array
    op: Op
    base: Expr
    values: tuple[float, ...]
    constant: Expr | None
    span: Span


@dataclass(frozen=True)
class Choose:
    """`then if condition else otherwise`. Only the chosen branch is evaluated. `and` and `or` are represented by it."""

    type: Type
    condition: Expr
    then: Expr
    otherwise: Expr
    span: Span


@dataclass(frozen=True)
class Let:
    """`body` with `value` bound to the hidden local `name`. Used for a value that is evaluated once and used twice, or
    whose parts are selected although it has no name."""

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
    """A call of a helper or library function by its unique name."""

    type: Type
    function: str
    args: tuple[Expr, ...]
    fault: bool
    span: Span


@dataclass(frozen=True)
class EffectCall:
    """The result of a call that reaches outside the machine, within an expression. check/effect_order.py replaces it
    by a statement (Effect)."""

    type: Type
    function: Extern
    args: tuple[Expr, ...]
    span: Span


#: Expressions with storage. Only some of them may be written.
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
    """The variable that a place refers to, wholly or in part."""
    while isinstance(place, Member | Element | Slice):
        place = place.base
    return place


def variable(place: Place) -> tuple[str, str]:
    """Key of the variable of a place: its record ("" if local) and its name."""
    found = root(place)
    return (found.record, found.name) if isinstance(found, Field) else ("", found.name)


def variables(e: Expr) -> set[tuple[str, str]]:
    """All variables that an expression reads."""
    own = {variable(e)} if isinstance(e, Place) else set()
    return own.union(*map(variables, children(e)))


def children(e: Expr) -> tuple[Expr, ...]:
    """The direct subexpressions of an expression."""
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
    """A function of C or Nim that the user declares. Scalars are passed by value; arrays and structs, also as results,
    by pointer. `header`: of C, or the Nim file."""

    name: str
    header: str
    arguments: tuple[tuple[str, Type], ...]
    result: Type | None
    span: Span
    language: str = "c"


@dataclass(frozen=True)
class Effect:
    """A call that reaches outside the machine: an extern, or a hardware builtin of fcsl_hw.h. Its arguments cannot
    fault."""

    function: Extern
    args: tuple[Expr, ...]
    target: Place | None  # receives the result
    span: Span

    @property
    def is_hardware(self) -> bool:
        return self.function.header == HARDWARE_HEADER


#: Header of the hardware builtins. Their C functions take the host as first argument.
HARDWARE_HEADER = "fcsl/fcsl_hw.h"


@dataclass(frozen=True)
class Event:
    """`event(text, …)`: told when the run of `execute` completes (events.py). It has no effect on the machine; its
    arguments cannot fault."""

    text: str
    severity: int
    args: tuple[Expr, ...]
    span: Span


Stmt = Assign | Effect | Event | If | For | Break | Continue | Return


def constant_rounds(loop: For) -> int | None:
    """Number of iterations of a loop with constant bounds, unless it is left before."""
    if not (isinstance(loop.start, Const) and isinstance(loop.stop, Const)):
        return None
    assert isinstance(loop.start.value, int) and isinstance(loop.stop.value, int)
    return len(range(loop.start.value, loop.stop.value, loop.step))


def walk(statements: tuple[Stmt, ...]) -> Iterator[Stmt]:
    """All statements of a body, nested ones included, in source order."""
    for s in statements:
        yield s
        if isinstance(s, If):
            yield from walk(s.then)
            yield from walk(s.otherwise)
        elif isinstance(s, For):
            yield from walk(s.body)


def expressions(s: Stmt) -> tuple[Expr, ...]:
    """The expressions that one statement evaluates, without those of nested statements."""
    if isinstance(s, Assign):
        return (s.target, s.value)
    if isinstance(s, Effect):
        return s.args if s.target is None else (*s.args, s.target)
    if isinstance(s, Event):
        return s.args
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


def writes(statements: tuple[Stmt, ...]) -> list[tuple[Place, Expr | None, Span]]:
    """All places that a body writes, with the value (None for the result of an effect), in source order."""
    found: list[tuple[Place, Expr | None, Span]] = []
    for s in walk(statements):
        if isinstance(s, Assign):
            found.append((s.target, s.value, s.span))
        elif isinstance(s, Effect) and s.target is not None:
            found.append((s.target, None, s.span))
    return found


# ---- functions and algorithms --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Undo:
    """What a fault restores in the function itself: a part of a field, with the local that holds its value from before the
    write. Its indices are constants and locals."""

    part: Place
    before: Local


@dataclass(frozen=True)
class Function:
    """`execute`, `start`, a helper, or a library function at fixed sizes."""

    name: str  # unique in the whole machine
    source_name: str  # as in the source
    arguments: tuple[tuple[str, Type], ...]
    records: tuple[str, ...]  # records that execute or start uses, in the order of RECORDS
    result: Type | None
    locals: tuple[tuple[str, Type], ...]
    body: tuple[Stmt, ...]
    faults: bool
    calls: tuple[str, ...]
    span: Span
    requests: tuple[tuple[str, Span], ...] = ()  # every literal request, with its first use
    loop_parameters: tuple[tuple[str, Span], ...] = ()  # parameters that bound a loop and must be frozen
    undone: tuple[Undo, ...] = ()  # in the order of the writes; made by lowering

    @cached_property
    def fields(self) -> frozenset[tuple[str, str]]:
        """The fields that it reads or writes, wholly or in part: record and name; "" is the record of locals."""
        return frozenset(v for s in walk(self.body) for e in expressions(s) for v in variables(e))

    @cached_property
    def uses_hardware(self) -> bool:
        return any(isinstance(s, Effect) and s.is_hardware for s in walk(self.body))

    @cached_property
    def has_events(self) -> bool:
        return any(isinstance(s, Event) for s in walk(self.body))

    @property
    def takes_host(self) -> bool:
        return self.uses_hardware or self.has_events

    @property
    def returned(self) -> str:
        """The local array that every return statement returns, or "". It shares the storage of the result."""
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
    default: tuple[bool | int | float | str, ...] | None = None  # of a parameter, in the order of the leaves


@dataclass(frozen=True)
class Algorithm:
    """One checked class, with the name that the machine JSON gives it."""

    name: str
    source: str  # path as in the machine JSON
    files: tuple[str, ...]  # its source and the files it imports from
    doc: str
    ports: dict[str, tuple[Port, ...]]  # inputs, parameters, outputs, state
    execute: Function
    start: Function | None
    requests: tuple[tuple[str, Span], ...] = field(default=())  # all literal requests, at first use
    externs: tuple[Extern, ...] = field(default=())  # all declared externs
    makes_requests: bool = False  # declares transition_request
    complete: bool = True  # False after a reported error: then it has its ports and an empty execute
    assigned: Mapping[str, frozenset[str]] = field(default_factory=dict)  # ports, by the method that assigns them

    @property
    def owner(self) -> str:
        """Prefix in C of its functions, and of its instances' frozen parameters (ModuleConst.owner)."""
        return f"alg_{self.name}"

    @property
    def effects(self) -> list[Effect]:
        """Its effects outside the machine. An algorithm with effects is impure."""
        return [s for s in walk(self.execute.body) if isinstance(s, Effect)]

    def port(self, record: str, name: str) -> Port | None:
        return next((p for p in self.ports[record] if p.name == name), None)
