# SPDX-License-Identifier: Apache-2.0
"""What names mean inside one function, and where functions come from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from ..base.source import SourceFile, Span
from ..model import ir, ops
from ..model.effects import HARDWARE
from ..model.literals import LiteralError
from ..model.types import SCALARS, Array, Scalar, Struct, Type, TypeNames
from .algorithm_class import AlgorithmClass

#: Array constructors, whose arguments are sizes.
CONSTRUCTORS = {
    "zeros": "zeros(n, …): an f64 array of zeros; sizes are constants.",
    "eye": "eye(n): the n×n identity, f64.",
}

#: Constants of fcsl_builtins: float literals.
BUILTIN_CONSTANTS = {"pi": math.pi, "inf": math.inf, "nan": math.nan}

#: Names whose meaning no program may change: in CPython a use before or after would mean something else.
LANGUAGE_NAMES = frozenset(
    {
        "extern",
        *HARDWARE,
        *ops.BUILTINS,
        *CONSTRUCTORS,
        *BUILTIN_CONSTANTS,
        *SCALARS,
        "range",
        "len",
        "__debug__",
    }
)


@dataclass(frozen=True)
class ScalarConstant:
    """A module constant with a type."""

    value: ir.Const


@dataclass(frozen=True)
class UntypedConstant:
    """A module constant that stands for the literals it is written with: its value in each type, or why there is none.
    Integers may be out of the type's range, as long as what is computed of them is not."""

    values: dict[Scalar, int | float | LiteralError]
    holds_float: bool


@dataclass(frozen=True)
class StoredConstant:
    """An array or struct; `values` are flat in the order of its leaves."""

    owner: str
    type: Array | Struct
    values: tuple[float | int | bool | str, ...]


Constant = ScalarConstant | UntypedConstant | StoredConstant


@dataclass(frozen=True)
class Signature:
    """A callable function at fixed sizes."""

    name: str
    arguments: tuple[Type, ...]
    result: Type
    faults: bool


class Functions(Protocol):
    """Finds (and checks, on first use) helpers and library functions; knows the externs."""

    externs: dict[str, ir.Extern]

    def is_function(self, name: str) -> bool: ...

    def names(self) -> list[str]: ...

    def declared(self, name: str, count: int) -> tuple[list[Type | None], Type | None]: ...

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        """The function for these arguments; None after it reported why there is none."""
        ...


@dataclass
class Scope:
    """State of checking one function body, statement by statement."""

    source: SourceFile
    constants: dict[str, Constant]
    functions: Functions
    arguments: dict[str, Type]
    names: TypeNames
    result: Type | None = None
    algorithm: AlgorithmClass | None = None  # whose `self` is in sight
    method: str = ""  # start or execute
    wrong: set[str] = field(default_factory=set)  # names of the module whose declaration was reported
    types: dict[str, tuple[Type, Span]] = field(default_factory=dict)
    assigned: set[str] = field(default_factory=set)
    poisoned: set[str] = field(default_factory=set)
    ranges: dict[str, ir.RangeVar] = field(default_factory=dict)
    dead_ranges: set[str] = field(default_factory=set)
    requests: dict[str, Span] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    loop_parameters: dict[str, Span] = field(default_factory=dict)  # that bound a loop, at their first use
    unreachable: bool = False
    faults: bool = False
