# SPDX-License-Identifier: Apache-2.0
"""Whole algorithm files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from . import oracle
from . import tree as t
from .choices import Choices
from .places import Scope
from .statements import Statements
from .types import FLOATS, HEALTH, NUMBERS, SCALARS, Array, Struct, Type, size

REQUESTS = ("GO", "HALT", "BACK")


@dataclass(frozen=True)
class Palette:
    """The types of a machine; few, so that ports find each other."""

    types: tuple[Type, ...]
    structs: tuple[Struct, ...]


def palette(c: Choices) -> Palette:
    scalars = [c.pick(SCALARS) for _ in range(c.between(2, 4))]
    arrays = [Array(c.pick((*NUMBERS, "f64", "bool")), _shape(c)) for _ in range(c.between(0, 3))]
    arrays += [Array("f64", c.pick(((3,), (4,), (3, 3), (2, 2))))] if c.chance(60) else []  # the library's
    structs: list[Struct] = []
    for n in range(c.weighted(((5, 0), (3, 1), (2, 2)))):
        members: list[Type] = [c.pick((*scalars, *arrays, *structs)) for _ in range(c.between(1, 3))]
        structs.append(Struct(f"S{n}", tuple((f"m{i}", m) for i, m in enumerate(members))))
    wide = [Array(c.pick(structs), c.pick(((2,), (1,), (3,), (2, 2))))] if structs and c.chance(40) else []
    return Palette((*dict.fromkeys((*scalars, *arrays, *structs, *wide)),), tuple(structs))


def _shape(c: Choices) -> tuple[int, ...]:
    rank = c.weighted(((6, 1), (3, 2), (1, 3)))
    return tuple(c.between(1, {1: 7, 2: 4, 3: 3}[rank]) for _ in range(rank))


def algorithm(c: Choices, name: str, types: Palette, library: bool) -> t.Algorithm:
    ports: dict[str, tuple[tuple[str, Type], ...]] = {
        "inputs": _ports(c, "a", types, 1, 4, health=c.chance(25)),
        "parameters": _ports(c, "k", types, 0, 2),
        "outputs": _ports(c, "r", types, 2, 5),
        "state": _ports(c, "s", types, 0, 3),
    }
    constants = _constants(c, types)
    helpers: tuple[t.Function, ...] = ()
    for n in range(c.weighted(((4, 0), (4, 1), (2, 2)))):
        helpers = (*helpers, _helper(c, f"f{n}", types, constants, helpers, library))
    requests = REQUESTS[: c.weighted(((4, 0), (3, 1), (2, 2), (1, 3)))]
    execute = _entry(c, "execute", ports, types, constants, helpers, requests, library)
    start = _entry(c, "start", ports, types, constants, helpers, (), library) if c.chance(20) else None
    return t.Algorithm(name, ports, constants, helpers, execute, start)


def _ports(
    c: Choices, letter: str, types: Palette, least: int, most: int, health: bool = False
) -> tuple[tuple[str, Type], ...]:
    ports = [(f"{letter}{n}", c.pick(types.types)) for n in range(c.between(least, most))]
    return tuple([*ports, *([("h", HEALTH)] if health else [])])


def _constants(c: Choices, types: Palette) -> tuple[t.Constant, ...]:
    found: list[t.Constant] = []
    for n in range(c.between(0, 4)):
        type_ = c.pick(types.types)
        if type_ != "bool" and size(type_) <= 12:
            found.append(_folded(c, f"C{n}", tuple(found)) or _constant(c, f"C{n}", type_))
    return tuple(found)


def _folded(c: Choices, name: str, earlier: tuple[t.Constant, ...]) -> t.Constant | None:
    """An operation on an earlier constant with a type; None where it would fault, which is an error."""
    known = [k for k in earlier if k.declared and k.type in NUMBERS]
    if not known or not c.chance(50):
        return None
    first = c.pick(known)
    type_ = str(first.type)
    a = t.Name(type_, first.name, True)
    b = t.Literal(type_, c.number(type_, 10)) if c.chance(50) else a
    symbols = ("+", "-", "*", *(("/",) if type_ in FLOATS else ("//", "%", "&", "|", "^")))
    made: t.Expr = t.Binary(type_, c.pick(symbols), a, b)
    if c.chance(30):
        kind = c.pick(NUMBERS)
        made = t.Call(kind, kind, (made,))
    try:
        value = oracle.constants_of((*earlier, t.Constant(name, made.type, None, True, made)))[name]
    except oracle.Fault:
        return None
    return t.Constant(name, made.type, value if isinstance(value, int) else float(value), True, made)


def _constant(c: Choices, name: str, type_: Type) -> t.Constant:
    if isinstance(type_, Struct) or (isinstance(type_, Array) and isinstance(type_.element, Struct)) or c.chance(50):
        value: Any = c.value(type_, 10) if isinstance(type_, str) else c.literal(type_)
        return t.Constant(name, type_, value, True)
    if isinstance(type_, Array):  # without a type its elements are bools, i64 or f64
        element = type_.element if type_.element == "bool" else "f64" if type_.element in FLOATS else "i64"
        bare = Array(element, type_.shape)
        return t.Constant(name, bare, c.literal(bare), False)
    bare_scalar = "f64" if type_ in FLOATS else "i64"
    return t.Constant(name, bare_scalar, c.number(bare_scalar, 10), False)


def _helper(
    c: Choices,
    name: str,
    types: Palette,
    constants: tuple[t.Constant, ...],
    helpers: tuple[t.Function, ...],
    library: bool,
) -> t.Function:
    arguments = tuple((f"x{n}", c.pick(types.types)) for n in range(c.between(1, 3)))
    result = c.pick(types.types)
    scope = Scope((), dict(arguments), constants, helpers, (), result)
    block = Statements(c, scope, types.types, 30, library).body(4)
    return t.Function(name, arguments, result, block)


def _entry(
    c: Choices,
    name: str,
    ports: dict[str, tuple[tuple[str, Type], ...]],
    types: Palette,
    constants: tuple[t.Constant, ...],
    helpers: tuple[t.Function, ...],
    requests: tuple[str, ...],
    library: bool,
) -> t.Function:
    records = tuple(r for r in ports if (ports[r] or r == "outputs") and not (name == "start" and r == "inputs"))
    fields = tuple(t.Field(k, r, n) for r in records for n, k in ports[r])
    words: tuple[t.Field, ...] = ()
    if name == "execute":
        words = (t.Field(HEALTH, "outputs", "health"), t.Field("TransitionRequest", "outputs", "transition_request"))
    scope = Scope((*fields, *words), {}, constants, helpers, requests, is_start=name == "start")
    fuel, most = (110, 10) if name == "execute" else (15, 3)
    block = Statements(c, scope, types.types, fuel, library).body(most)
    return t.Function(name, (), None, block, records)
