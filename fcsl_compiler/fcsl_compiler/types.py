# SPDX-License-Identifier: Apache-2.0
"""The value types of the dialect."""

from __future__ import annotations

import re
from dataclasses import dataclass

#: Scalars in one array; larger data does not belong on a control path's stack.
MAX_ELEMENTS = 1 << 16


@dataclass(frozen=True)
class Scalar:
    """A scalar type. `c` is its C type, `abi` its name in fcsl_machine.h, `ros` its type in a .msg file."""

    name: str
    c: str
    abi: str
    ros: str
    size: int
    low: int = 0
    high: int = 0

    def __str__(self) -> str:
        return self.name

    @property
    def is_float(self) -> bool:
        return self.name in ("f32", "f64")

    @property
    def is_integer(self) -> bool:
        return self.high != 0

    @property
    def is_signed(self) -> bool:
        return self.low != 0

    @property
    def is_number(self) -> bool:
        return self.is_float or self.is_integer


BOOL = Scalar("bool", "bool", "FCSL_BOOL", "bool", 1)
I32 = Scalar("i32", "int32_t", "FCSL_I32", "int32", 4, -(1 << 31), (1 << 31) - 1)
I64 = Scalar("i64", "int64_t", "FCSL_I64", "int64", 8, -(1 << 63), (1 << 63) - 1)
U32 = Scalar("u32", "uint32_t", "FCSL_U32", "uint32", 4, 0, (1 << 32) - 1)
U64 = Scalar("u64", "uint64_t", "FCSL_U64", "uint64", 8, 0, (1 << 64) - 1)
F32 = Scalar("f32", "float", "FCSL_F32", "float32", 4)
F64 = Scalar("f64", "double", "FCSL_F64", "float64", 8)
REQUEST = Scalar("TransitionRequest", "int32_t", "FCSL_TRANSITION_REQUEST", "int32", 4)
HEALTH = Scalar("Health", "int32_t", "FCSL_HEALTH", "uint8", 4)

SCALARS: dict[str, Scalar] = {t.name: t for t in (BOOL, I32, I64, U32, U64, F32, F64, REQUEST, HEALTH)}
NUMBERS: tuple[Scalar, ...] = (I32, I64, U32, U64, F32, F64)

#: Order of badness of the first three; `stale` is what the scheduler says of an instance that has not run.
HEALTH_NAMES: tuple[str, ...] = ("nominal", "degraded", "failed", "stale")


@dataclass(frozen=True)
class Array:
    """A fixed array of scalars, row-major; `shape` has one extent per dimension."""

    element: Scalar
    shape: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.element}[{', '.join(map(str, self.shape))}]"

    @property
    def count(self) -> int:
        total = 1
        for extent in self.shape:
            total *= extent
        return total


Type = Scalar | Array


def scalar_of(type_: Type) -> Scalar:
    return type_.element if isinstance(type_, Array) else type_


def shape_of(type_: Type) -> tuple[int, ...]:
    return type_.shape if isinstance(type_, Array) else ()


def count_of(type_: Type) -> int:
    return type_.count if isinstance(type_, Array) else 1


_TYPE = re.compile(r"\s*([A-Za-z_][A-Za-z0-9_]*)\s*(?:\[([^\]]*)\])?\s*(.*?)\s*", re.DOTALL)
_UNIT = re.compile(r"[A-Za-z0-9µ°%Ω*/^().\- ]{1,40}")


class TypeSyntaxError(ValueError):
    """Not a type; args are the message and a hint."""


def parse_type(text: str, sizes: dict[str, int], allow_unit: bool) -> tuple[Type, str]:
    """Parses `f64`, `f64[3]`, `f64[2, 2]`, each with an optional unit behind it when `allow_unit`.

    `sizes` gives named extents (module constants, size variables of library functions).
    Returns the type and the unit ("" without one). Raises TypeSyntaxError.
    """
    match = _TYPE.fullmatch(text)
    if not match:
        raise TypeSyntaxError(
            f"`{text}` is not a type", 'write a scalar type such as `f64`, or an array such as "f64[3]"'
        )
    name, extents, unit = match.group(1), match.group(2), match.group(3)
    scalar = SCALARS.get(name)
    if scalar is None:
        hint = {"float": "write `f64`", "int": "write `i64`, or another of i32, u32, u64", "double": "write `f64`"}
        raise TypeSyntaxError(f"unknown type `{name}`", hint.get(name, f"the types are {', '.join(SCALARS)}"))
    if unit and not allow_unit:
        raise TypeSyntaxError(f"a unit (`{unit}`) belongs to ports only", "remove it here")
    if unit and not _UNIT.fullmatch(unit):
        raise TypeSyntaxError(f"`{unit}` is not a unit", "write it like `rad/s`, `m/s^2`, `N*m`")
    if extents is None:
        return scalar, unit
    shape = tuple(_extent(part.strip(), sizes) for part in extents.split(","))
    array = Array(scalar, shape)
    if array.count > MAX_ELEMENTS:
        raise TypeSyntaxError(f"an array of {array.count} elements", f"at most {MAX_ELEMENTS} fit")
    return array, unit


def _extent(text: str, sizes: dict[str, int]) -> int:
    if re.fullmatch(r"[0-9]{1,9}", text):
        extent = int(text)
    elif text in sizes:
        extent = sizes[text]
    else:
        raise TypeSyntaxError(f"`{text}` is not an array size", "a size is a positive integer or a module constant")
    if extent < 1:
        raise TypeSyntaxError("an array without elements", "every size is at least 1")
    return extent
