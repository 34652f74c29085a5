# SPDX-License-Identifier: Apache-2.0
"""What names mean inside one function, and where functions come from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from . import ir, ops
from .effects import HARDWARE
from .source import SourceFile, Span
from .types import SCALARS, Array, Struct, Type, TypeNames

#: Array constructors, whose arguments are sizes.
CONSTRUCTORS = {
    "zeros": "zeros(n, …): an f64 array of zeros; sizes are constants.",
    "eye": "eye(n): the n×n identity, f64.",
}

#: Constants of fcsl_builtins; like literals, they adopt the type of the other operand.
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
        "__debug__",
        "Inputs",
        "Parameters",
        "Outputs",
        "State",
    }
)


@dataclass(frozen=True)
class ScalarConstant:
    """A module constant without a type of its own (it adopts one like a literal), or with one."""

    value: ir.Const


@dataclass(frozen=True)
class StoredConstant:
    """An array or struct; `values` are flat in the order of its leaves."""

    owner: str
    type: Array | Struct
    values: tuple[float | int | bool, ...]


Constant = ScalarConstant | StoredConstant


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

    def guides(self, name: str, count: int) -> list[Type | None]: ...

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        """The function for these arguments; None after it reported why there is none."""
        ...


@dataclass
class Scope:
    """State of checking one function body, statement by statement."""

    source: SourceFile
    constants: dict[str, Constant]
    records: dict[str, str]  # argument name -> inputs, parameters, outputs or state
    ports: dict[str, dict[str, ir.Port]]  # record -> field -> port
    functions: Functions
    arguments: dict[str, Type]
    names: TypeNames
    result: Type | None = None
    effects: bool = False  # whether this function may reach outside the machine
    wrong: set[str] = field(default_factory=set)  # ports and constants whose declaration was reported
    types: dict[str, tuple[Type, Span]] = field(default_factory=dict)
    assigned: set[str] = field(default_factory=set)
    bare: set[str] = field(default_factory=set)  # locals whose type is that of a bare literal
    poisoned: set[str] = field(default_factory=set)
    ranges: dict[str, ir.RangeVar] = field(default_factory=dict)
    dead_ranges: set[str] = field(default_factory=set)
    requests: dict[str, Span] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    unreachable: bool = False
    faults: bool = False
