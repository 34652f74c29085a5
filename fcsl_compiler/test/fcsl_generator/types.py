# SPDX-License-Identifier: Apache-2.0
"""Types of generated programs, and their values in a machine JSON or from a host."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

SIGNED = ("i32", "i64")
UNSIGNED = ("u32", "u64")
INTEGERS = (*SIGNED, *UNSIGNED)
FLOATS = ("f32", "f64")
NUMBERS = (*INTEGERS, *FLOATS)
SCALARS = ("bool", *NUMBERS)
HEALTH = "Health"
HEALTH_NAMES = ("nominal", "degraded", "failed", "stale")
REQUEST = "TransitionRequest"
REQUESTS = ("GO", "HALT", "BACK")
#: Scalar types with named values: a string, whose type the context determines.
WORDS = (HEALTH, REQUEST)
RANGE = {
    "i32": (-(1 << 31), (1 << 31) - 1),
    "i64": (-(1 << 63), (1 << 63) - 1),
    "u32": (0, (1 << 32) - 1),
    "u64": (0, (1 << 64) - 1),
}
WIDTH = {"i32": 32, "i64": 64, "u32": 32, "u64": 64}


@dataclass(frozen=True)
class Struct:
    name: str
    members: tuple[tuple[str, Type], ...]

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Array:
    element: str | Struct
    shape: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.element}{''.join(f'[{extent}]' for extent in self.shape)}"


@dataclass(frozen=True)
class Results:
    """The results of a helper with several results."""

    types: tuple[Type, ...]

    def __str__(self) -> str:
        return f"tuple[{', '.join(map(str, self.types))}]"


#: A scalar is its name.
Type = str | Struct | Array | Results


def row(array: Array) -> Type:
    """The type of array[i]."""
    return Array(array.element, array.shape[1:]) if len(array.shape) > 1 else array.element


def zero(type_: Type) -> Any:
    """The zero value in the form of a JSON literal: lists, objects, numbers, bools, names of healths and requests."""
    if isinstance(type_, Array):
        return [zero(row(type_)) for _ in range(type_.shape[0])]
    if isinstance(type_, Struct):
        return {name: zero(member) for name, member in type_.members}
    if type_ == "bool":
        return False
    if type_ in WORDS:
        return "nominal" if type_ == HEALTH else ""
    return 0.0 if type_ in FLOATS else 0


def element(type_: Type) -> str | Struct:
    """The element type of an array; any other type itself."""
    return type_.element if isinstance(type_, Array) else type_


def size(type_: Type) -> int:
    """Number of scalars in a value of this type."""
    if isinstance(type_, Array):
        return math.prod(type_.shape) * size(type_.element)
    return sum(size(t) for _, t in type_.members) if isinstance(type_, Struct) else 1


def leaves(type_: Type, value: Any, path: str) -> Iterator[tuple[str, str, Any]]:
    """(path, scalar, value) for each leaf as in the field table. An array of scalars is one leaf."""
    if isinstance(type_, Struct):
        for name, member in type_.members:
            yield from leaves(member, value[name], f"{path}.{name}")
    elif isinstance(type_, Array) and isinstance(type_.element, Struct):
        for i in range(type_.shape[0]):
            yield from leaves(row(type_), value[i], f"{path}[{i}]")
    elif isinstance(type_, Array):
        yield path, str(type_.element), value
    else:
        yield path, type_, value
