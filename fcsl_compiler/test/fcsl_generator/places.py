# SPDX-License-Identifier: Apache-2.0
"""Names in scope of a body, and the paths from a name to the values inside it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

from . import tree as t
from .types import HEALTH, HEALTH_NAMES, REQUESTS, Array, Struct, Type


@dataclass(frozen=True)
class Step:
    """One step into a value: a member, or one pair of brackets with an index (None) or the width of a slice per
    dimension."""

    member: str = ""
    dimensions: tuple[int | None, ...] = ()


Way = tuple[Step, ...]


@cache
def ways(type_: Type) -> tuple[tuple[Way, Type], ...]:
    """All paths into a value of this type with the resulting type. The first is the value itself."""
    return ((), type_), *_into(type_)


def _into(type_: Type) -> Iterator[tuple[Way, Type]]:
    if isinstance(type_, Struct):
        for name, member in type_.members:
            for way, found in ways(member):
                yield (Step(member=name), *way), found
    elif isinstance(type_, Array):
        yield from _brackets(type_)


def _brackets(array: Array) -> Iterator[tuple[Way, Type]]:
    for given in range(1, len(array.shape) + 1):
        for dimensions in itertools.product(*((None, *range(1, n + 1)) for n in array.shape[:given])):
            shape = (*(w for w in dimensions if w is not None), *array.shape[given:])
            step = Step(dimensions=dimensions)
            if shape:
                yield (step,), Array(array.element, shape)
                continue
            yield (step,), array.element
            for way, found in _into(array.element):
                yield (step, *way), found


@dataclass
class Scope:
    """Names of one function. `locals_` have a type; those in `assigned` have a value on every path."""

    fields: tuple[t.Field, ...] = ()
    arguments: dict[str, Type] = field(default_factory=dict)
    constants: tuple[t.Constant, ...] = ()
    helpers: tuple[t.Function, ...] = ()
    externs: tuple[t.Extern, ...] = ()
    result: Type | None = None
    method: str = ""  # execute or start; "" in a helper
    locals_: dict[str, Type] = field(default_factory=dict)
    assigned: set[str] = field(default_factory=set)
    loops: dict[str, tuple[int, int]] = field(default_factory=dict)
    jumped: bool = False  # the enclosing loop's body contains a break, continue or return

    def names(self) -> list[t.Name]:
        return [t.Name(k, n) for n, k in self.locals_.items() if n in self.assigned]

    def readable(self) -> list[t.Expr]:
        """Roots of values: locals, arguments, fields, typed constants."""
        out: list[t.Expr] = [*self.names(), *(t.Name(k, n) for n, k in self.arguments.items()), *self.fields]
        return out + [t.Name(c.type, c.name, True) for c in self.constants if c.declared or isinstance(c.type, Array)]

    def writable(self) -> list[t.Expr]:
        """Roots that can be assigned, except `health`, which accepts only some values of its type."""
        fields = (f for f in self.fields if f.record in ("outputs", "state") and f.name != "health")
        return [*self.names(), *fields]

    def words(self, type_: Type) -> list[t.Word]:
        """Names of this type, and constants without a type that can have it."""
        plain = HEALTH_NAMES if type_ == HEALTH else ("", *REQUESTS)
        bare = [t.Word(type_, c.value, c.name) for c in self.constants if c.type == type_ and not c.declared]
        return [*(t.Word(type_, word) for word in plain), *bare]

    def bare(self, type_: Type) -> list[t.Literal]:
        """Constants without a type, as literals of this type."""
        return [
            t.Literal(type_, c.value, True, c.name)
            for c in self.constants
            if c.type in ("i64", "f64") and not c.declared and (c.type == "f64") == t.is_float(type_)
        ]
