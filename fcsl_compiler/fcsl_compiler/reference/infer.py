# SPDX-License-Identifier: Apache-2.0
"""Infers scalar type and shape of every expression of a function before the rewrite.

Expressions that share one scalar type are neighbours in a graph. A declared type propagates from neighbour to
neighbour. Without one, a float literal makes a group f64, otherwise it is i64. The compiler has accepted the program,
so nothing is checked here.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeGuard

from ..model.events import EVENT
from .annotations import split_type
from .functions import CONVERSIONS, ON_INTEGERS, PREDICATES

#: Sizes of an array: numbers, and names where they are not known yet (UNKNOWN: never).
Shape = tuple[int | str, ...]
UNKNOWN = "?"
#: Bases of kinds in the library that the arguments of a call decide: floats, and all numbers.
ELEMENTS = ("F", "T")
#: In the place of the default of an argument that has none.
REQUIRED = object()


@dataclass(frozen=True)
class Kind:
    """A type. Bases are those of values and, in addition, `int`, `float` and `str` for names that denote literals,
    and PLAIN for indices computed from literals and loop variables alone, which are Python integers."""

    base: str
    shape: Shape = ()
    parts: tuple[Kind, ...] = ()  # kinds of several results

    @property
    def rank(self) -> int:
        return len(self.shape)


def kind_of(annotation: ast.expr, sizes: Mapping[str, int] | None = None) -> Kind:
    """The kind that an annotation declares. `sizes`: names of sizes that are known."""
    if isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple):  # tuple[f64, f64]
        return Kind("tuple", (), tuple(kind_of(part, sizes) for part in annotation.slice.elts))
    name, extents = split_type(annotation_text(annotation))
    return Kind(name, tuple(int(e) if e.isdigit() else (sizes or {}).get(e, e) for e in extents))


def annotation_text(annotation: ast.expr) -> str:
    if isinstance(annotation, ast.Constant):
        return str(annotation.value)
    return ast.unparse(annotation).replace("(", "").replace(")", "")


PLAIN = "plain"
#: The base of `self` in a method. It is not a valid name of a struct.
SELF = "algorithm.self"


@dataclass
class Names:
    """Names that a file declares and can use."""

    members: Mapping[str, Mapping[str, Kind]]  # members of structs, and of an algorithm's `self`
    functions: dict[str, tuple[list[Kind], Kind]]  # arguments and result
    constants: dict[str, Kind] = field(default_factory=dict)
    text: str = ""  # text of the file
    values: dict[str, Any] = field(default_factory=dict)  # of all names, as far as they are known
    parameters: Collection[str] = ()  # of an algorithm: those that an instance may freeze
    #: Arguments of helpers by name, each with its default (REQUIRED: it has none).
    arguments: dict[str, dict[str, Any]] = field(default_factory=dict)
    #: Makers of library functions for classes of arguments, by name (library.py).
    library: Mapping[str, Callable[..., Callable[..., Any]]] = field(default_factory=dict)
    #: Additional names in rewritten code: literals, and constants that denote literals, each with a type.
    literals: dict[str, Any] = field(default_factory=dict)

    def literal(self, constant: str, base: str) -> str:
        """Name of a constant of literals, in this type."""
        return f"fcsl.{base} {constant}"

    def literals_of(self, constant: str) -> dict[str, Any]:
        """Values that an importing file needs."""
        names = [self.literal(constant, base) for base in ("f64", "f32")]
        return {name: self.literals[name] for name in names if name in self.literals}

    def text_of(self, literal: ast.Constant) -> str:
        """Source text of a literal."""
        return str(ast.get_source_segment(self.text, literal))

    def is_constant(self, node: ast.expr) -> bool:
        """Whether an expression is the name of a constant."""
        return isinstance(node, ast.Name) and node.id in self.constants

    def given(self, name: str, node: ast.Call) -> list[ast.expr | None]:
        """The arguments of a call by position, None for one that has its default."""
        named = {keyword.arg: keyword.value for keyword in node.keywords}
        return [*node.args, *(named.get(argument) for argument in list(self.arguments.get(name, ()))[len(node.args) :])]

    def function(self, node: ast.Call) -> str:
        """The function that a call refers to. A library function with optional arguments has one overload per number of
        arguments."""
        assert isinstance(node.func, ast.Name)
        variant = f"{node.func.id}__{len(node.args)}"
        return variant if variant in self.functions else node.func.id


def is_event(node: ast.expr) -> TypeGuard[ast.Call]:
    """Whether a statement is `event(text, …)`."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == EVENT


class Node:
    """An unknown scalar type, with the nodes of equal type."""

    __slots__ = ("base", "index", "is_float", "mixed", "named", "near")

    def __init__(self, base: str = "", is_float: bool = False, named: bool = False):
        self.base, self.is_float, self.named = base, is_float, named
        self.index = self.mixed = False
        self.near: list[Node] = []


@dataclass
class Seen:
    """An expression: scalar type, dimensions, and whether it consists of literals only."""

    node: Node
    shape: Shape = ()
    literal: bool = False
    parts: tuple[Kind, ...] = ()


_CONSTANTS = {"pi": Kind("float"), "inf": Kind("float"), "nan": Kind("float")}


class Inference:
    """Inference for one function body, or one constant."""

    def __init__(self, names: Names, arguments: Mapping[str, Kind], result: Kind | None = None):
        self.names, self.result = names, result
        self.seen: dict[ast.AST, Seen] = {}
        self.locals: dict[str, Seen] = {name: _declared(kind) for name, kind in arguments.items()}
        self.variables: set[ast.expr] = set()  # uses of loop variables and of `len`
        self._loops: set[str] = set()
        self._powers: list[tuple[Node, Node]] = []  # base and exponent
        self._shifts: list[tuple[Node, Node]] = []  # literal and count

    # ---- the graph -------------------------------------------------------------------------------------------------

    def solve(self) -> None:
        """Assigns a type to every expression."""
        for base, exponent in self._powers:
            if not (_base(_reached(base)) and _base(_reached(exponent))):
                _connect(base, exponent)
        for operand, count in self._shifts:
            if not _base(_reached(operand)):
                _connect(operand, Node(_base(_reached(count))))
        done: set[int] = set()
        for seen in [*self.seen.values(), *self.locals.values()]:
            if id(seen.node) not in done:
                group = _reached(seen.node)
                done.update(map(id, group))
                found = _base(group) or _default(group)
                mixed = len({node.base for node in group if node.base}) > 1
                for node in group:
                    node.base, node.mixed = found, mixed

    def kind(self, node: ast.expr) -> Kind:
        seen = self.seen[node]
        return Kind(seen.node.base, seen.shape)

    def certain(self, node: ast.expr) -> Kind | None:
        """The kind of an expression if all that it meets agrees on it, as in every program that the compiler
        accepts."""
        seen = self.seen.get(node)
        if seen is None or seen.node.mixed or not all(isinstance(extent, int) for extent in seen.shape):
            return None
        return Kind(seen.node.base, seen.shape)

    def is_literal(self, node: ast.expr) -> bool:
        return node in self.seen and self.seen[node].literal

    def constant(self, node: ast.expr, declared: Kind | None) -> None:
        """One constant value of a module."""
        value = self.expr(node)
        if declared is not None:
            self._same(_declared(declared), value)
        self.solve()

    # ---- statements ------------------------------------------------------------------------------------------------

    def body(self, statements: list[ast.stmt]) -> None:
        for s in statements:
            self.statement(s)

    def statement(self, s: ast.stmt) -> None:
        if isinstance(s, ast.Assign):
            self._assign(s.targets[0], s.value)
        elif isinstance(s, ast.AugAssign):
            self._augmented(s)
        elif isinstance(s, ast.AnnAssign) and s.value is not None:
            assert isinstance(s.target, ast.Name)
            self.locals[s.target.id] = _declared(kind_of(s.annotation))
            self._same(self.locals[s.target.id], self.expr(s.value))
        elif isinstance(s, ast.If):
            self.expr(s.test)
            self.body(s.body)
            self.body(s.orelse)
        elif isinstance(s, ast.Assert):
            self.expr(s.test)
        elif isinstance(s, ast.For):
            assert isinstance(s.target, ast.Name) and isinstance(s.iter, ast.Call)
            for bound in s.iter.args:
                self._index(bound)
            self._loops.add(s.target.id)
            self.body(s.body)
            self._loops.discard(s.target.id)
        elif isinstance(s, ast.Return) and s.value is not None:
            self._return(s.value)
        elif isinstance(s, ast.Expr) and is_event(s.value):
            for arg in s.value.args[1:]:
                self.expr(arg)
        elif isinstance(s, ast.Expr):
            self.expr(s.value)

    def _return(self, value: ast.expr) -> None:
        if isinstance(value, ast.Tuple):
            assert self.result is not None
            for kind, part in zip(self.result.parts, value.elts, strict=True):
                self._same(_declared(kind), self.expr(part))
        else:
            found = self.expr(value)
            if self.result is not None:
                self._same(_declared(self.result), found)

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            if isinstance(value, ast.Tuple | ast.List):
                parts = [self.expr(part) for part in value.elts]
            else:
                whole = self.expr(value)
                rows = [Seen(whole.node, whole.shape[1:])] * len(target.elts)
                parts = [_declared(kind) for kind in whole.parts] or rows
            for place, part in zip(target.elts, parts, strict=True):
                self._bind(place, part)
        else:
            self._bind(target, self.expr(value))

    def _bind(self, target: ast.expr, value: Seen) -> None:
        if isinstance(target, ast.Name) and target.id not in self.locals:
            self.locals[target.id] = Seen(Node(named=True), value.shape)
            if value.node.base in self.names.members:
                self.locals[target.id] = Seen(value.node, value.shape)
        place = self.locals[target.id] if isinstance(target, ast.Name) else self.expr(target)
        self._same(place, value)

    def _augmented(self, s: ast.AugAssign) -> None:
        place, value = self.expr(s.target), self.expr(s.value)
        if isinstance(s.op, ast.Pow):
            self._power(place, s.value, value)
        elif not isinstance(s.op, ast.LShift | ast.RShift):
            self._same(place, value)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def expr(self, node: ast.expr) -> Seen:
        found: Seen = getattr(self, f"_on_{type(node).__name__.lower()}")(node)
        self.seen[node] = found
        return found

    def _same(self, *parts: Seen) -> Seen:
        """Gives all operands one scalar type. The result has the largest number of dimensions."""
        for part in parts[1:]:
            _connect(parts[0].node, part.node)
        return Seen(parts[0].node, max((part.shape for part in parts), key=len))

    def _on_constant(self, node: ast.Constant) -> Seen:
        number = type(node.value) in (int, float)
        base = "bool" if type(node.value) is bool else ""
        return Seen(Node(base, is_float=type(node.value) is float), (), number)

    def _on_name(self, node: ast.Name) -> Seen:
        if node.id in self._loops:
            self.variables.add(node)
            return Seen(Node())
        if node.id in self.locals:
            found = self.locals[node.id]
            return Seen(found.node, found.shape)
        kind = self.names.constants.get(node.id) or _CONSTANTS[node.id]
        if kind.base in ("int", "float"):
            return Seen(Node(is_float=kind.base == "float"), (), True)
        if kind.base == "str":
            return Seen(Node())
        return _declared(kind)

    def _on_attribute(self, node: ast.Attribute) -> Seen:
        base = self.expr(node.value)
        return _declared(self.names.members[base.node.base][node.attr])

    def _on_subscript(self, node: ast.Subscript) -> Seen:
        parts = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
        base = self.expr(node.value)
        for part in parts:
            self._index(part)
        sliced = [self._extent(s, e) for s, e in zip(parts, base.shape, strict=False) if isinstance(s, ast.Slice)]
        return Seen(base.node, (*sliced, *base.shape[len(parts) :]))

    def _extent(self, part: ast.Slice, extent: int | str) -> int | str:
        """The number of elements that a slice selects."""
        bounds = [None if bound is None else self.value(bound) for bound in (part.lower, part.upper)]
        known = all(bound is None or self.value(bound) is not None for bound in (part.lower, part.upper))
        return len(range(extent)[slice(*bounds)]) if isinstance(extent, int) and known else UNKNOWN

    def value(self, node: ast.expr) -> int | None:
        """An integer that the source states: a literal, its negation, or a constant."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            inner = self.value(node.operand)
            return None if inner is None else -inner
        found = node.value if isinstance(node, ast.Constant) else None
        if isinstance(node, ast.Name) and self.names.is_constant(node) and node.id not in self.locals:
            found = self.names.values.get(node.id)
        return int(found) if isinstance(found, int) and type(found) is not bool else None

    def _index(self, node: ast.expr) -> None:
        """A subscript or a bound of a range."""
        if isinstance(node, ast.Slice):
            for bound in (node.lower, node.upper):
                if bound is not None:
                    self._index(bound)
            return
        self.expr(node).node.index = True

    def _on_unaryop(self, node: ast.UnaryOp) -> Seen:
        operand = self.expr(node.operand)
        return Seen(Node("bool")) if isinstance(node.op, ast.Not) else operand

    def _on_binop(self, node: ast.BinOp) -> Seen:
        left, right = self.expr(node.left), self.expr(node.right)
        literal = left.literal and right.literal
        if isinstance(node.op, ast.Pow):
            return self._power(left, node.right, right)
        if isinstance(node.op, ast.LShift | ast.RShift):
            if left.literal:
                self._shifts.append((left.node, right.node))
            elif not right.literal:
                left.node.named = True  # a 64-bit number: the count may be too large
            return Seen(left.node, (), literal)
        found = self._same(left, right)
        return Seen(found.node, found.shape, literal)

    def _power(self, base: Seen, node: ast.expr, exponent: Seen) -> Seen:
        if exponent.literal and not any(n.is_float for n in _reached(exponent.node)):
            exponent.node.index = True
            return Seen(base.node, (), base.literal)
        self._powers.append((base.node, exponent.node))
        return Seen(base.node)

    def _on_compare(self, node: ast.Compare) -> Seen:
        operands = self._same(*map(self.expr, (node.left, *node.comparators)))
        return Seen(Node("bool"), operands.shape)

    def _on_boolop(self, node: ast.BoolOp) -> Seen:
        for value in node.values:
            self.expr(value)
        return Seen(Node("bool"))

    def _on_ifexp(self, node: ast.IfExp) -> Seen:
        self.expr(node.test)
        then, other = self.expr(node.body), self.expr(node.orelse)
        if then.node.base in self.names.members:
            return Seen(then.node, then.shape)
        return self._same(then, other)

    def _on_list(self, node: ast.List) -> Seen:
        items = [self.expr(item) for item in node.elts]
        first = items[0]
        if first.node.base in self.names.members:
            return Seen(first.node, (len(items), *first.shape))
        return Seen(self._same(*items).node, (len(items), *first.shape))

    def _on_call(self, node: ast.Call) -> Seen:
        assert isinstance(node.func, ast.Name)
        name = self.names.function(node)
        if name in self.names.functions:
            return self._function(name, node)
        given = [self.expr(arg) for arg in node.args]
        if name in self.names.members:
            members = self.names.members[name]
            for kind, seen in zip(members.values(), given, strict=False):
                self._same(_declared(kind), seen)
            for keyword in node.keywords:
                self._same(_declared(members[str(keyword.arg)]), self.expr(keyword.value))
            return Seen(Node(name))
        if name in ("zeros", "eye"):
            for seen in given:
                seen.node.index = True
            sizes = [UNKNOWN if size is None else size for size in map(self.value, node.args)]
            return Seen(Node(is_float=True), tuple(sizes if name == "zeros" else sizes * 2))
        if name == "len":
            self.variables.add(node)
            return Seen(Node())
        if name in CONVERSIONS:
            return self._conversion(name, given[0])
        operand = self._same(*(given[1:] if name == "where" else given))
        operand.node.is_float |= name not in ON_INTEGERS
        shape = max((seen.shape for seen in given), key=len)
        return Seen(Node("bool") if name in PREDICATES else operand.node, shape, name == "sqrt" and given[0].literal)

    def _function(self, name: str, node: ast.Call) -> Seen:
        wanted, result = self.names.functions[name]
        arguments = [None if argument is None else self.expr(argument) for argument in self.names.given(name, node)]
        pairs = [(kind, seen) for kind, seen in zip(wanted, arguments, strict=False) if seen is not None]
        elements = {"F": Node(is_float=True), "T": Node()}

        def declared(kind: Kind) -> Seen:
            return Seen(elements[kind.base], kind.shape) if kind.base in ELEMENTS else _declared(kind)

        for kind, seen in pairs:
            self._same(declared(kind), seen)
        return declared(_bound(result, pairs))

    def _conversion(self, name: str, given: Seen) -> Seen:
        """`f32(0.1)` is a literal of that type; `i32(3.7)` converts a literal."""
        target = CONVERSIONS[name]
        if name == target and given.literal:
            is_float = any(n.is_float for n in _reached(given.node))
            if target in ("f32", "f64") or not is_float:
                _connect(given.node, Node(target))
        return Seen(Node(target), given.shape)


def _declared(kind: Kind) -> Seen:
    return Seen(Node(kind.base, named=True), kind.shape, parts=kind.parts)


def _bound(result: Kind, arguments: list[tuple[Kind, Seen]]) -> Kind:
    """The result of a function with the sizes that its arguments have."""
    sizes: dict[int | str, int | str] = {}
    for kind, seen in arguments:
        sizes |= zip(kind.shape, seen.shape, strict=False)

    def bound(kind: Kind) -> Kind:
        shape = tuple(e if isinstance(e, int) else sizes.get(e, e) for e in kind.shape)
        return replace(kind, shape=shape, parts=tuple(map(bound, kind.parts)))

    return bound(result)


def _connect(one: Node, other: Node) -> None:
    one.near.append(other)
    other.near.append(one)


def _reached(node: Node) -> list[Node]:
    """All nodes with the same type as this one."""
    found, waiting = {id(node): node}, [node]
    while waiting:
        for near in waiting.pop().near:
            if id(near) not in found:
                found[id(near)] = near
                waiting.append(near)
    return list(found.values())


def _default(group: list[Node]) -> str:
    """Type of a group without a declared type."""
    if any(n.index for n in group) and not any(n.named for n in group):
        return PLAIN
    return "f64" if any(n.is_float for n in group) else "i64"


def _base(group: list[Node]) -> str:
    return next((node.base for node in group if node.base), "")
