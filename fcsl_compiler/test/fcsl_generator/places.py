# SPDX-License-Identifier: Apache-2.0
"""What is in scope of a body, and the ways from a name to the values inside it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

from . import tree as t
from .types import Array, Struct, Type


@dataclass(frozen=True)
class Step:
    """One step into a value: a member, or one pair of brackets with an index (None) or the width of a slice per dimension."""

    member: str = ""
    dimensions: tuple[int | None, ...] = ()


Way = tuple[Step, ...]


@cache
def ways(type_: Type) -> tuple[tuple[Way, Type], ...]:
    """Every way into a value of this type with the type that it leads to; the first is the value itself."""
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
    """Names of one function. `locals_` have a type; those in `assigned` have a value on every path to here."""

    fields: tuple[t.Field, ...] = ()
    arguments: dict[str, Type] = field(default_factory=dict)
    constants: tuple[t.Constant, ...] = ()
    helpers: tuple[t.Function, ...] = ()
    requests: tuple[str, ...] = ()
    result: Type | None = None
    is_start: bool = False
    locals_: dict[str, Type] = field(default_factory=dict)
    assigned: set[str] = field(default_factory=set)
    loops: dict[str, tuple[int, int]] = field(default_factory=dict)
    jumped: bool = False  # a break, continue or return stands in the body of the loop around

    def names(self) -> list[t.Name]:
        return [t.Name(k, n) for n, k in self.locals_.items() if n in self.assigned]

    def readable(self) -> list[t.Expr]:
        """Roots of values: locals, arguments, fields, typed constants."""
        out: list[t.Expr] = [*self.names(), *(t.Name(k, n) for n, k in self.arguments.items()), *self.fields]
        return out + [t.Name(c.type, c.name, True) for c in self.constants if c.declared or isinstance(c.type, Array)]

    def writable(self) -> list[t.Expr]:
        words = ("Health", "TransitionRequest")
        fields = (f for f in self.fields if f.record in ("outputs", "state") and f.type not in words)
        return [*self.names(), *fields]

    def bare(self, type_: Type) -> list[t.Literal]:
        """Constants without a type of their own, as literals of this type."""
        return [
            t.Literal(type_, c.value, True, c.name)
            for c in self.constants
            if not (c.declared or isinstance(c.type, Array)) and (c.type == "f64") == t.is_float(type_)
        ]
