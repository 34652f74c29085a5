# SPDX-License-Identifier: Apache-2.0
"""The value types of the language."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field

from ..base.diagnostics import nearest
from ..base.source import Span

#: Maximum number of scalars in one array. Larger data does not fit the stack of a control path.
MAX_ELEMENTS = 1 << 16
#: Maximum number of members in one value, nested ones included. Each is a row of the machine's field table.
MAX_LEAVES = 1 << 12


@dataclass(frozen=True)
class Scalar:
    """A scalar type. `c`: its C type. `abi`: its name in fcsl_machine.h. `ros`: its type in a .msg file."""

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
#: Names in the signatures of the library for a type that the arguments decide.
ELEMENTS: dict[str, tuple[Scalar, ...]] = {"F": (F64, F32), "T": (F64, *NUMBERS[:-1])}
INTEGERS: tuple[Scalar, ...] = (I32, I64, U32, U64)

#: The first three are ordered from best to worst. The scheduler sets `stale` for an instance that has not run.
HEALTH_NAMES: tuple[str, ...] = ("nominal", "degraded", "failed", "stale")


@dataclass(frozen=True)
class Member:
    """One member of a struct."""

    name: str
    type: Type
    unit: str


@dataclass(frozen=True)
class Struct:
    """A struct of the machine JSON with its members in order. `partial`: some members had a reported error and are
    missing."""

    name: str
    members: tuple[Member, ...]
    partial: bool = field(default=False, compare=False)
    span: Span | None = field(default=None, compare=False, repr=False)  # of its name in the machine JSON
    #: Number of scalars, and of leaves, in a value. Cached, because nested structs have many paths.
    count: int = field(init=False, compare=False)
    leaf_count: int = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "count", sum(count_of(m.type) for m in self.members))
        object.__setattr__(self, "leaf_count", sum(leaf_count_of(m.type) for m in self.members))

    def __hash__(self) -> int:
        return hash(self.name)  # hashing the members would recurse

    def __str__(self) -> str:
        return self.name

    def member(self, name: str) -> Member | None:
        return next((m for m in self.members if m.name == name), None)


@dataclass(frozen=True)
class Results(Struct):
    """Several results of a helper: a struct without a name in the source. Equal types give the same struct."""

    __hash__ = Struct.__hash__

    def __str__(self) -> str:
        return f"tuple[{', '.join(str(m.type) for m in self.members)}]"


def results_of(types: tuple[Type, ...]) -> Results:
    """The type for these results."""
    names = [re.sub(r"\W+", "_", str(t)).strip("_") for t in types]
    return Results("__".join(["results", *names]), tuple(Member(f"r{n}", t, "") for n, t in enumerate(types)))


@dataclass(frozen=True)
class Array:
    """A fixed-size array of scalars or structs, row-major. `shape` has one size per dimension."""

    element: Scalar | Struct
    shape: tuple[int, ...]

    def __str__(self) -> str:
        return f"{self.element}{''.join(f'[{extent}]' for extent in self.shape)}"

    @property
    def count(self) -> int:
        return math.prod(self.shape)


Type = Scalar | Array | Struct


def element_of(type_: Type) -> Scalar | Struct:
    """The element type of an array; any other type itself."""
    return type_.element if isinstance(type_, Array) else type_


def scalar_of(type_: Type) -> Scalar:
    """The scalar type of a leaf."""
    element = element_of(type_)
    assert isinstance(element, Scalar)
    return element


def shape_of(type_: Type) -> tuple[int, ...]:
    return type_.shape if isinstance(type_, Array) else ()


def count_of(type_: Type) -> int:
    """Number of scalars in a value of this type."""
    if isinstance(type_, Array):
        return type_.count * count_of(type_.element)
    return type_.count if isinstance(type_, Struct) else 1


def leaf_count_of(type_: Type) -> int:
    """Number of leaves in a value of this type."""
    if isinstance(type_, Array) and isinstance(type_.element, Struct):
        return type_.count * type_.element.leaf_count
    return type_.leaf_count if isinstance(type_, Struct) else 1


@dataclass(frozen=True)
class Leaf:
    """A scalar, or an array of scalars, within a value. `steps` is the path to it: member names and flat indices of
    struct arrays."""

    path: str  # such as ".position" or "[2].valid"; "" for the value itself
    steps: tuple[str | int, ...]
    type: Scalar | Array
    unit: str


def leaves(type_: Type, unit: str = "") -> list[Leaf]:
    """The leaves of a value in storage order."""
    if isinstance(type_, Struct):
        found = []
        for m in type_.members:
            found += [_below(f".{m.name}", m.name, leaf) for leaf in leaves(m.type, m.unit)]
        return found
    if isinstance(type_, Array) and isinstance(type_.element, Struct):
        inner = leaves(type_.element)
        places = [(n, "".join(f"[{i}]" for i in index)) for n, index in enumerate(_indices(type_.shape))]
        return [_below(text, n, leaf) for n, text in places for leaf in inner]
    return [Leaf("", (), type_, unit)]


def _below(path: str, step: str | int, leaf: Leaf) -> Leaf:
    return Leaf(path + leaf.path, (step, *leaf.steps), leaf.type, leaf.unit)


def _indices(shape: tuple[int, ...]) -> itertools.product[tuple[int, ...]]:
    return itertools.product(*map(range, shape))


@dataclass
class TypeNames:
    """Names other than scalar types that an annotation may use."""

    sizes: dict[str, int]  # named sizes: integer constants of the module, size variables of library functions
    structs: dict[str, Struct]
    numbers: dict[str, int | float] = field(default_factory=dict)  # constants of the module, for ranges


_TYPE = re.compile(r"\s*([A-Za-z_][A-Za-z0-9_]*)\s*((?:\[[^\[\]]*\]\s*)*)(.*?)\s*", re.DOTALL)
_UNIT = re.compile(r"[A-Za-z0-9µ°%Ω*/^().\- ]{1,40}")


class TypeSyntaxError(ValueError):
    """Not a valid type. args: message text and help text."""


def parse_type(text: str, names: TypeNames, allow_unit: bool) -> tuple[Type, str]:
    """Parses `f64`, `f64[3]`, `Pose` or `Pose[2][2]` (2 rows of 2), followed by an optional unit if `allow_unit`.

    Returns the type and the unit ("" without one). Raises TypeSyntaxError.
    """
    match = _TYPE.fullmatch(text)
    if not match:
        raise TypeSyntaxError(
            f"`{text}` is not a type", 'write a scalar type such as `f64`, or an array such as "f64[3]"'
        )
    name, unit = match.group(1), match.group(3)
    extents: list[str] = [part.strip() for part in re.findall(r"\[([^\]]*)\]", match.group(2))]
    element = SCALARS.get(name) or names.structs.get(name)
    if element is None:
        hint = {"float": "write `f64`", "int": "write `i64`, or another of i32, u32, u64", "double": "write `f64`"}
        hint["tuple"] = "only the result of a helper is one; write an array or a struct"
        known = [*SCALARS, *names.structs]
        fix = (
            hint.get(name)
            or nearest(name, known)
            or f"the types are {', '.join(known)}; structs are of the machine JSON"
        )
        raise TypeSyntaxError(f"unknown type `{name}`", fix)
    if unit.startswith("[") and "]" not in unit:
        size, rest = re.fullmatch(r"\[\s*(\w*)\s*(.*)", unit, re.DOTALL).groups()  # type: ignore[union-attr]
        fix = f"{name}{match.group(2).strip()}[{size or 3}]{' ' if rest else ''}{rest}"
        raise TypeSyntaxError(f"`{text}`: a bracket is not closed", f'write "{fix}"')
    if unit and not allow_unit:
        raise TypeSyntaxError(f"a unit (`{unit}`) belongs to ports only", "remove it here")
    if any("," in extent for extent in extents):
        split = "".join(f"[{part.strip()}]" for extent in extents for part in extent.split(","))
        behind = f" {unit}" if unit else ""
        raise TypeSyntaxError(f"`{text.strip()}`: each size has separate brackets", f'write "{name}{split}{behind}"')
    if ".." in unit:
        raise TypeSyntaxError(f"`{unit}` is not a unit", "a range follows `in`, and only parameters have one")
    if unit and not is_unit(unit):
        raise TypeSyntaxError(f"`{unit}` is not a unit", "write it like `rad/s`, `m/s^2`, `N*m`")
    if unit and isinstance(element, Struct):
        raise TypeSyntaxError(f"a unit (`{unit}`) after a struct", "declare units at its members, in the machine JSON")
    if not extents:
        return element, unit
    array = Array(element, tuple(_extent(extent, names.sizes) for extent in extents))
    check_size(array)
    return array, unit


def is_unit(text: str) -> bool:
    return _UNIT.fullmatch(text) is not None


def check_size(type_: Type) -> None:
    """Raises TypeSyntaxError for a value with too many scalars or fields."""
    if count_of(type_) > MAX_ELEMENTS:
        raise TypeSyntaxError(f"{type_} holds {count_of(type_)} scalars", f"at most {MAX_ELEMENTS} fit")
    if leaf_count_of(type_) > MAX_LEAVES:
        raise TypeSyntaxError(f"{type_} has {leaf_count_of(type_)} members", f"at most {MAX_LEAVES} are allowed")


def _extent(text: str, sizes: dict[str, int]) -> int:
    if re.fullmatch(r"[0-9]{1,9}", text):
        extent = int(text)
    elif text in sizes:
        extent = sizes[text]
    else:
        raise TypeSyntaxError(
            f"`{text}` is not an array size",
            "a size is a positive integer or a module constant; `sizes` of an algorithm or the call of a helper bind lower-case ones",
        )
    if extent < 1:
        raise TypeSyntaxError("an array without elements", "every size is at least 1")
    return extent
