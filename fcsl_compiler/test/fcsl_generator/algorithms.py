# SPDX-License-Identifier: Apache-2.0
"""Generates algorithm files: classes, and the helpers and constants that they share."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from . import oracle
from . import tree as t
from .choices import Choices
from .places import Scope
from .statements import Statements
from .types import FLOATS, HEALTH, NUMBERS, REQUEST, SCALARS, WORDS, Array, Results, Struct, Type, element, size

#: Valid port names that modules, the language, Python or C also use.
_ODD_NAMES = (
    "f0 v0 x0 i0 self min range f64 dt parameter m0 memset main type print C0 S0 Alg0 double int NULL header tick INFINITY machine "
    "struct errno"
).split()
_SNAKE = re.compile(r"[a-z](_?[a-z0-9])*")
_NO_OUTPUT = ("double", "int", "header", "tick", "struct")


@dataclass(frozen=True)
class Palette:
    """The types of a machine. The set is small, so that ports of equal type occur."""

    types: tuple[Type, ...]
    structs: tuple[Struct, ...]
    externs: tuple[t.Extern, ...] = ()


def palette(c: Choices) -> Palette:
    scalars: list[Type] = [c.pick(SCALARS) for _ in range(c.between(2, 4))]
    scalars += [c.pick(WORDS) for _ in range(c.weighted(((6, 0), (3, 1), (1, 2))))]
    arrays = [Array(c.pick((*NUMBERS, "f64", "bool")), _shape(c)) for _ in range(c.between(0, 3))]
    arrays += [Array("f64", c.pick(((3,), (4,), (3, 3), (2, 2))))] if c.chance(60) else []  # types of library functions
    arrays += [Array(c.pick(WORDS), c.pick(((2,), (3,), (2, 2))))] if c.chance(20) else []
    structs: list[Struct] = []
    for n in range(c.weighted(((5, 0), (3, 1), (2, 2)))):
        members: list[Type] = [c.pick((*scalars, *arrays, *structs)) for _ in range(c.between(1, 3))]
        structs.append(Struct(f"S{n}", tuple((f"m{i}", m) for i, m in enumerate(members))))
    wide = [Array(c.pick(structs), c.pick(((2,), (1,), (3,), (2, 2))))] if structs and c.chance(40) else []
    types = (*dict.fromkeys((*scalars, *arrays, *structs, *wide)),)
    return Palette(types, tuple(structs), _externs(c, [k for k in types if _is_known_to_c(k)]))


def _externs(c: Choices, types: list[Type]) -> tuple[t.Extern, ...]:
    """Declares C functions for all files, with the types that the programs use."""
    found: list[t.Extern] = []
    for n in range(c.weighted(((5, 0), (2, 1), (2, 2), (1, 4))) if types else 0):
        arguments = tuple((f"x{i}", c.pick(types)) for i in range(c.between(0, 3)))
        found.append(t.Extern(n, arguments, c.pick(types) if c.chance(70) else None, not c.chance(30)))
    return tuple(found)


def _is_known_to_c(type_: Type) -> bool:
    """Whether a type contains no healths and requests, which C does not have."""
    inner = element(type_)
    return all(_is_known_to_c(k) for _, k in inner.members) if isinstance(inner, Struct) else inner not in WORDS


def _shape(c: Choices) -> tuple[int, ...]:
    rank = c.weighted(((6, 1), (3, 2), (1, 3)))
    return tuple(c.between(1, {1: 7, 2: 4, 3: 3}[rank]) for _ in range(rank))


# ---- files ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Program:
    """Files, and the classes of them that a machine uses, by their keys in the JSON."""

    files: tuple[t.File, ...]
    algorithms: dict[str, tuple[t.File, t.Algorithm]]
    externs: tuple[t.Extern, ...] = ()


def program(c: Choices, types: Palette, count: int) -> Program:
    """`count` entries of `algorithms`, in at most as many files. Some files contain only imported names."""
    folder = c.pick(("", "", "algorithms/"))
    files: list[t.File] = []
    for n in range(c.weighted(((6, 0), (3, 1), (1, 2)))):
        path = c.pick((f"{folder}shared{n}.py", f"{folder}parts/shared.py" if n == 0 else f"{folder}parts/more.py"))
        files.append(_file(c, path, types, files, 0))
    chosen: list[tuple[t.File, t.Algorithm]] = []
    while len(chosen) < count:
        missing = count - len(chosen)
        classes = c.between(2, missing) if missing > 1 and c.chance(40) else 1
        files.append(_file(c, f"{folder}alg{len(chosen)}.py", types, files, classes + c.chance(10)))
        chosen += [(files[-1], a) for a in files[-1].classes[:classes]]  # further classes are not used
        if len(chosen) < count and c.chance(15):
            chosen.append(chosen[-1])  # with another key
    return Program(tuple(files), _keys(c, chosen), types.externs)


def _keys(c: Choices, chosen: list[tuple[t.File, t.Algorithm]]) -> dict[str, tuple[t.File, t.Algorithm]]:
    """Keys of the chosen classes: the class name, or another name if it is taken or by choice."""
    found: dict[str, tuple[t.File, t.Algorithm]] = {}
    for n, (file, algorithm) in enumerate(chosen):
        other = algorithm.name in found or c.chance(25)
        found[f"key{n}" if other else algorithm.name] = (file, algorithm)
    return found


def _file(c: Choices, path: str, types: Palette, others: list[t.File], classes: int) -> t.File:
    module = _Module(c, types)
    for other in others:
        module.import_from(path, other)
    module.define(classes)
    return t.File(
        path,
        tuple(module.imports),
        tuple(module.constants),
        tuple(module.helpers),
        tuple(module.classes),
        module.for_editors,
        module.externs,
    )


@dataclass
class _Module:
    """Contents of one file under construction. `seen` and `usable` are its constants and helpers, imported ones
    included."""

    c: Choices
    types: Palette
    imports: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)
    constants: list[t.Constant] = field(default_factory=list)
    helpers: list[t.Function] = field(default_factory=list)
    classes: list[t.Algorithm] = field(default_factory=list)
    seen: tuple[t.Constant, ...] = ()
    usable: tuple[t.Function, ...] = ()
    for_editors: bool = False
    library: bool = False
    externs: tuple[t.Extern, ...] = ()

    def import_from(self, path: str, other: t.File) -> None:
        """Imports some definitions from a file in the same folder or in a subfolder."""
        here, there = (p.rpartition("/")[0] for p in (path, other.path))
        below = f"{here}/" if here else ""
        if not (there == here or there.startswith(below)):
            return
        taken = self._names()
        constants = [k for k in other.constants if k.name not in taken and self.c.chance(60)]
        helpers = [h for h in other.helpers if h.name not in taken and self.c.chance(60)]
        names = [*(k.name for k in constants), *(h.name for h in helpers)]
        if names:
            self.imports.append((other.path.removeprefix(below).removesuffix(".py").replace("/", "."), tuple(names)))
            self.seen, self.usable = (*self.seen, *constants), (*self.usable, *helpers)

    def _names(self) -> set[str]:
        return {*(k.name for k in self.seen), *(h.name for h in self.usable), *(a.name for a in self.classes)}

    def _free(self, letter: str) -> str:
        """The first unused name with this letter."""
        taken = self._names()
        return next(name for name in (f"{letter}{n}" for n in range(100)) if name not in taken)

    def define(self, classes: int) -> None:
        c = self.c
        self.for_editors, self.library = c.chance(20), c.chance(50)
        self.externs = tuple(c.some(self.types.externs, 80)) if classes else ()
        for _ in range(c.between(0, 4)):
            self._constant()
        for _ in range(c.weighted(((4, 0), (4, 1), (2, 2))) if classes else c.between(1, 2)):
            self._helper()
        for _ in range(classes):
            self.classes.append(self._algorithm())

    # ---- constants -------------------------------------------------------------------------------------------------

    def _constant(self) -> None:
        type_ = self.c.pick(self.types.types)
        if type_ == "bool" or size(type_) > 12:
            return
        made = self._folded() or self._plain(self._free("C"), type_)
        self.constants.append(made)
        self.seen = (*self.seen, made)

    def _folded(self) -> t.Constant | None:
        """An operation on an earlier constant with a type. None if it would fault, which is a compile error."""
        c = self.c
        known = [k for k in self.seen if k.declared and k.type in NUMBERS]
        if not known or not c.chance(50):
            return None
        first, name = c.pick(known), self._free("C")
        type_ = str(first.type)
        a = t.Name(type_, first.name, True)
        b = t.Literal(type_, c.number(type_, 10)) if c.chance(50) else a
        symbols = ("+", "-", "*", *(("/",) if type_ in FLOATS else ("//", "%", "&", "|", "^")))
        made: t.Expr = t.Binary(type_, c.pick(symbols), a, b)
        if c.chance(30):
            kind = c.pick(NUMBERS)
            made = t.Call(kind, kind, (made,))
        try:
            value = oracle.Frame(oracle.constants_of(self.seen), {}, {}).value(made)
        except oracle.Fault:
            return None
        return t.Constant(name, made.type, value if isinstance(value, int) else float(value), True, made)

    def _plain(self, name: str, type_: Type) -> t.Constant:
        c, inner = self.c, element(type_)
        if isinstance(type_, str) and type_ in WORDS:
            word = c.value(type_)
            return t.Constant(name, type_, word, not word or c.chance(60))
        if isinstance(inner, Struct) or inner in WORDS or c.chance(50):
            value: Any = c.value(type_, 10) if isinstance(type_, str) else c.literal(type_)
            return t.Constant(name, type_, value, True)
        if isinstance(type_, Array):  # without a type its elements are bools, i64 or f64
            bare = Array(inner if inner == "bool" else "f64" if inner in FLOATS else "i64", type_.shape)
            return t.Constant(name, bare, c.literal(bare), False)
        bare_scalar = "f64" if type_ in FLOATS else "i64"
        return t.Constant(name, bare_scalar, c.number(bare_scalar, 10), False)

    # ---- functions -------------------------------------------------------------------------------------------------

    def _helper(self) -> None:
        c, types = self.c, self.types.types
        arguments = tuple((f"x{n}", c.pick(types)) for n in range(c.between(1, 3)))
        result: Type = c.pick(types)
        if c.chance(25):
            result = Results(tuple(c.pick(types) for _ in range(c.between(2, 3))))
        scope = Scope((), dict(arguments), self.seen, self.usable, result=result)
        block = Statements(c, scope, types, 30, self.library).body(4)
        made = t.Function(self._free("f"), arguments, result, block, self.seen, not c.chance(30))
        self.helpers.append(made)
        self.usable = (*self.usable, made)

    def _algorithm(self) -> t.Algorithm:
        c = self.c
        taken: set[str] = set()
        ports = {
            "inputs": self._ports("a", 1, 4, taken, health=c.chance(25)),
            "parameters": self._ports("k", 0, 2, taken),
            "outputs": self._ports("r", 2, 5, taken),
            "state": self._ports("s", 0, 3, taken),
        }
        requests = c.chance(60)
        execute = self._method("execute", ports, requests)
        start = self._method("start", ports, False) if c.chance(20) else None
        return t.Algorithm(self._free("Alg"), ports, self.seen, execute, start, requests, self._look())

    def _ports(
        self, letter: str, least: int, most: int, taken: set[str], health: bool = False
    ) -> tuple[tuple[str, Type], ...]:
        c, ports = self.c, []
        for n in range(c.between(least, most)):
            name, odd = f"{letter}{n}", c.pick(_ODD_NAMES) if c.chance(6) else ""
            fits = letter != "r" or (_SNAKE.fullmatch(odd) and odd not in _NO_OUTPUT)
            name = odd if odd and fits and odd not in taken else name
            taken.add(name)
            ports.append((name, c.pick(self.types.types)))
        return tuple([*ports, *([("h", HEALTH)] if health else [])])

    def _method(self, name: str, ports: dict[str, tuple[tuple[str, Type], ...]], requests: bool) -> t.Function:
        records = [r for r in ports if not (name == "start" and r == "inputs")]
        fields = [t.Field(k, r, n) for r in records for n, k in ports[r]]
        if name == "execute":
            fields.append(t.Field(HEALTH, "outputs", "health"))
            fields += [t.Field(REQUEST, "outputs", "transition_request")] if requests else []
        scope = Scope(tuple(fields), {}, self.seen, self.usable, self.externs, method=name)
        fuel, most = (110, 10) if name == "execute" else (15, 3)
        block = Statements(self.c, scope, self.types.types, fuel, self.library).body(most)
        return t.Function(name, (), None, block, self.seen)

    def _look(self) -> t.Look:
        c = self.c
        if not c.chance(40):
            return t.Look()
        turned = c.upto(3)
        order = (*t.Look().records[turned:], *t.Look().records[:turned])
        annotated = c.pick(("", "dict[str, str]", "ClassVar[dict[str, str]]", "ClassVar"))
        return t.Look(order, annotated, c.chance(30), c.chance(50), c.chance(50), c.chance(30))
