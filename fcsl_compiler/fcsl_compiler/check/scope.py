# SPDX-License-Identifier: Apache-2.0
"""Names within one function, and the interface that resolves functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Protocol

from ..base.source import SourceFile, Span
from ..model import ir, ops
from ..model.effects import HARDWARE
from ..model.events import EVENT
from ..model.literals import LiteralError
from ..model.types import SCALARS, Array, Scalar, Struct, Type, TypeNames
from .algorithm_class import AlgorithmClass

#: Array constructors. Their arguments are sizes.
CONSTRUCTORS = {
    "zeros": "zeros(n, …): an f64 array of zeros; sizes are constants.",
    "eye": "eye(n): the n×n identity, f64.",
}

#: Constants of fcsl_builtins: float literals.
BUILTIN_CONSTANTS = {"pi": math.pi, "inf": math.inf, "nan": math.nan}

#: Names that a program must not redefine: a redefinition would have a different effect in CPython.
LANGUAGE_NAMES = frozenset(
    {
        "extern",
        EVENT,
        *HARDWARE,
        *ops.BUILTINS,
        *CONSTRUCTORS,
        *BUILTIN_CONSTANTS,
        *SCALARS,
        "range",
        "len",
        "__debug__",
        # names of a method
        "self",
        "__class__",
    }
)
#: Those that a constant or a local may have as its name, in a file that does not use them otherwise.
SHADOWABLE = frozenset({EVENT, *ops.BUILTINS, *CONSTRUCTORS, *BUILTIN_CONSTANTS}) - ops.CONVERSIONS - frozenset(SCALARS)


@dataclass(frozen=True)
class ScalarConstant:
    """A module constant with a type."""

    value: ir.Const


@dataclass(frozen=True)
class UntypedConstant:
    """A module constant without a type: each use replaces it by its literals. `values` holds its value, or the error,
    for each numeric type. An integer may exceed its type as long as the results computed from it fit."""

    values: dict[Scalar, int | float | LiteralError]
    holds_float: bool


@dataclass(frozen=True)
class StoredConstant:
    """An array or struct constant. `values` lists its leaves in order."""

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


@dataclass(frozen=True)
class Arguments:
    """The arguments of a helper, as a call may give them. `shown`: its first line. `at`: its definition."""

    names: tuple[str, ...]
    defaults: dict[str, ir.Const]
    shown: str
    at: Span


class Functions(Protocol):
    """Resolves helpers, library functions and externs. Helpers and library functions are checked on first use."""

    externs: dict[str, ir.Extern]

    def is_function(self, name: str) -> bool: ...

    def names(self) -> list[str]: ...

    def declared(self, name: str, count: int) -> tuple[list[Type | str | None], Type | str | None]: ...

    def arguments(self, name: str) -> Arguments | None:
        """The arguments of a helper. None for a function of the library."""
        ...

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        """The function for these arguments. None after reporting why none matches."""
        ...


@dataclass
class Scope:
    """State while one function body is checked, statement by statement."""

    source: SourceFile
    constants: dict[str, Constant]
    functions: Functions
    arguments: dict[str, Type]
    names: TypeNames
    result: Type | None = None
    variables: Collection[str] = ()  # names of sizes that a call or the machine JSON binds
    uses_library: Callable[[str], bool] = lambda name: True  # whether the file means that name of the library
    algorithm: AlgorithmClass | None = None  # the class that `self` refers to, None in helpers
    method: str = ""  # start or execute
    wrong: set[str] = field(default_factory=set)  # module-level names with a reported declaration error
    types: dict[str, tuple[Type, Span]] = field(default_factory=dict)
    assigned: set[str] = field(default_factory=set)
    single: set[str] = field(default_factory=set)  # locals that one statement assigns
    bounds: dict[str, tuple[int, int]] = field(default_factory=dict)  # of those that are integers
    poisoned: set[str] = field(default_factory=set)
    ranges: dict[str, ir.RangeVar] = field(default_factory=dict)
    dead_ranges: set[str] = field(default_factory=set)
    requests: dict[str, Span] = field(default_factory=dict)
    calls: list[str] = field(default_factory=list)
    loop_parameters: dict[str, Span] = field(default_factory=dict)  # parameters that bound a loop, with their first use
    unreachable: bool = False
    faults: bool = False
