# SPDX-License-Identifier: Apache-2.0
"""Generates an expression of any type from the names in scope."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from . import catalog, oracle
from . import tree as t
from .choices import Choices, single
from .places import Scope, Step, Way, ways
from .types import (
    FLOATS,
    INTEGERS,
    NUMBERS,
    RANGE,
    SIGNED,
    WIDTH,
    WORDS,
    Array,
    Results,
    Struct,
    Type,
    element,
    row,
    size,
)

#: How the type of a literal is determined: by the expression itself; by its context, for literals; or by its context,
#: also for loop variables.
TYPED, LITERAL, FREE = 0, 1, 2

#: Maximum size of an array that is written element by element.
_WRITTEN = 12

_NEAR_TIES = ("1.00000005960464477540", "1.00000005960464477538", "16777217.0000000001", "0.1000000000000000055511")

_ONE_FLOAT = ("sqrt", "floor", "ceil", "trunc", "round", "wrap_angle")
_TWO_FLOATS = (*oracle.ELEMENTARY_2, "fmod", "copysign")


class Expressions:
    """Generates expressions. `fuel` limits the nodes of a whole body, `depth` those on one path."""

    def __init__(self, choices: Choices, scope: Scope, fuel: int, library: bool):
        self.c, self.scope, self.fuel, self.library = choices, scope, fuel, library
        #: The variable being assigned. Values that overlap with it are read more often.
        self.target: t.Expr | None = None
        self._conditions = 0  # number of enclosing conditions that decide whether this expression is evaluated

    def expr(self, type_: Type, depth: int, mode: int = TYPED) -> t.Expr:
        if depth <= 0 or self.fuel <= 0:
            return self.leaf(type_, mode)
        self.fuel -= 1
        if isinstance(type_, Array):
            return self._array(type_, depth, mode)
        if isinstance(type_, Struct):
            return self._struct(type_, depth)
        if type_ in NUMBERS:
            return self._number(type_, depth, mode)
        return self._bool(depth) if type_ == "bool" else self._word(type_, depth, mode)

    def knows(self, type_: Type) -> bool:
        """Whether an expression can determine this type by itself. The name of a health cannot."""
        inner = element(type_)
        return inner not in WORDS or bool(self._places(inner))

    @contextmanager
    def conditional(self) -> Iterator[None]:
        """Context of an expression that is evaluated only on a condition."""
        self._conditions += 1
        yield
        self._conditions -= 1

    def _one_of(self, options: list[tuple[int, Callable[[], t.Expr]]]) -> t.Expr:
        return self.c.weighted(options)()

    # ---- leaves ----------------------------------------------------------------------------------------------------

    def leaf(self, type_: Type, mode: int = TYPED) -> t.Expr:
        places = self._places(type_)
        if isinstance(type_, Array | Struct):
            own = [p for p in places if p[0] == self.target]
            if own and self.c.chance(40):
                return self.place(*self.c.pick(own))
            return self.place(*self.c.pick(places)) if places and self.c.chance(80) else self._written(type_, 0, mode)
        if type_ in WORDS:
            named = mode == TYPED or (places and self.c.chance(50))
            return self.place(*self.c.pick(places)) if named else self.c.pick(self.scope.words(type_))
        loops = [n for n, (low, high) in self.scope.loops.items() if _fits(type_, low, high)]
        loops = loops if mode == FREE or type_ == "i64" else []
        if loops and self.c.chance(30):
            return t.LoopVar(type_, self.c.pick(loops))
        return self.place(*self.c.pick(places)) if places and not self.c.chance(25) else self.constant(type_, mode)

    def constant(self, type_: Type, mode: int = TYPED) -> t.Literal:
        """A literal or a constant's name, without a type if the context determines it."""
        if type_ == "bool":
            return t.Literal("bool", self.c.chance(50))
        named = self.scope.bare(type_)
        fitting = [n for n in named if _finite_in(type_, n.value) or _fits(type_, n.value, n.value)]
        if fitting and self.c.chance(25):
            found = self.c.pick(fitting)
            return found if mode else t.Literal(type_, found.value, False, found.name)
        if t.is_float(type_) and self.c.chance(5):
            return t.Literal(type_, math.pi, bool(mode), "pi")
        if type_ in FLOATS and self.c.chance(5):  # a tie as an f64 that is not one between two f32
            text = self.c.pick(_NEAR_TIES)
            return t.Literal(type_, float(text), bool(mode), text)
        value = self.c.number(str(type_), 8)
        if t.is_float(type_) and value in (1.0, 2.0, 3.0, 10.0) and self.c.chance(50):
            return t.Literal(type_, int(value), bool(mode))
        return t.Literal(type_, value, bool(mode))

    def _places(self, type_: Type) -> list[tuple[t.Expr, Way]]:
        return [(e, way) for e in self.scope.readable() for way, found in ways(e.type) if found == type_]

    def named(self, type_: Type) -> t.Expr | None:
        """A stored value of this type, if there is one."""
        places = self._places(type_)
        return self.place(*self.c.pick(places)) if places else None

    def place(self, root: t.Expr, way: Way) -> t.Expr:
        for step in way:
            root = self._member(root, step.member) if step.member else self._index(root, step)
        return root

    def _member(self, base: t.Expr, name: str) -> t.Expr:
        assert isinstance(base.type, Struct)
        return t.Member(dict(base.type.members)[name], base, name)

    def _index(self, base: t.Expr, step: Step) -> t.Expr:
        array = base.type
        assert isinstance(array, Array)
        indices: list[t.Expr | t.Slice] = []
        for width, extent in zip(step.dimensions, array.shape, strict=False):
            indices.append(self.index(extent) if width is None else self._slice(width, extent))
        shape = (*(w for w in step.dimensions if w is not None), *array.shape[len(step.dimensions) :])
        apart = len(indices) > 1 and all(w is None for w in step.dimensions) and self.c.chance(30)
        return t.Index(Array(array.element, shape) if shape else array.element, base, tuple(indices), apart)

    def _slice(self, width: int, extent: int) -> t.Slice:
        low = self.c.upto(extent - width)
        high = low + width
        negative = self.c.chance(20)
        first = None if low == 0 and self.c.chance(50) else low - extent if negative and low else low
        last = None if high == extent and self.c.chance(50) else high - extent if negative and high < extent else high
        return t.Slice(first, last)

    def index(self, extent: int) -> t.Expr:
        """A constant in range, an expression of loop variables, any value modulo the extent, or (rarely) any value."""
        loops = [found for name in self.scope.loops for found in self._of_loop(name, extent)]
        if loops and self.c.chance(60):
            return self.c.pick(loops)
        if self.c.chance(50):
            literal = t.Literal("i64", self.c.upto(extent - 1))
            return t.Literal("i64", literal.value - extent) if self.c.chance(20) else literal
        kind = self.c.pick(INTEGERS)
        if self.c.chance(25):  # in range for every value
            value = self.expr(kind, 1)
            if self.c.chance(50):
                return t.Binary(kind, "%", value, t.Literal(kind, extent))
            return t.Call(kind, "clamp", (value, t.Literal(kind, 0), t.Literal(kind, extent - 1)))
        found = self.opaque(kind)
        if found is None:
            return t.Literal("i64", 0)
        if self.c.chance(90):
            return t.Binary(kind, "%", found, t.Literal(kind, extent + self.c.chance(8)))
        return found

    def _of_loop(self, name: str, extent: int) -> list[t.Expr]:
        """i, i + 1, 2 - i, 2 * i, i + j where they can be in range. If they are not, the result is a fault."""
        variable, bounds = t.LoopVar("i64", name), self.scope.loops[name]
        found: list[tuple[t.Expr, list[int]]] = [(variable, [*bounds])]
        for n in (1, 2, 3):
            literal = t.Literal("i64", n)
            found.append((t.Binary("i64", "+", variable, literal), [b + n for b in bounds]))
            found.append((t.Binary("i64", "-", variable, literal), [b - n for b in bounds]))
            found.append((t.Binary("i64", "-", literal, variable), [n - b for b in bounds]))
            found.append((t.Binary("i64", "*", literal, variable), [n * b for b in bounds]))
        for other, (low, high) in self.scope.loops.items():
            sums = [bounds[0] + low, bounds[1] + high]
            found.append((t.Binary("i64", "+", variable, t.LoopVar("i64", other)), sums))
        surely = [e for e, ends in found if min(ends) >= 0 and max(ends) < extent]
        maybe = [e for e, ends in found if min(ends) < extent and max(ends) >= 0]
        return surely + (maybe if not surely or self.c.chance(25) else [])

    def opaque(self, kind: str) -> t.Expr | None:
        """An integer that no compiler can bound. An index proven out of range would be an error, not a fault."""
        readable = [e for e in self.scope.readable() if e.type == kind]
        # A local that one statement assigns has the bounds of what it is assigned.
        values = [e for e in readable if not isinstance(e, t.Name) or (not e.constant and e.name.startswith("x"))]
        if not values:
            return None
        found = self.c.pick(values)
        return t.Binary(kind, self.c.pick("+-"), found, self.c.pick(values)) if self.c.chance(25) else found

    # ---- numbers ---------------------------------------------------------------------------------------------------

    def _pair(self, type_: Type, depth: int) -> tuple[t.Expr, t.Expr]:
        """Two operands. One has a type; the other may adopt it."""
        if self.c.chance(30):
            return self.expr(type_, depth - 1, FREE), self.expr(type_, depth - 1, TYPED)
        return self.expr(type_, depth - 1, TYPED), self.expr(type_, depth - 1, FREE)

    def _number(self, type_: str, depth: int, mode: int) -> t.Expr:
        options: list[tuple[int, Callable[[], t.Expr]]] = [
            (8, lambda: self.leaf(type_, mode)),
            (14, lambda: t.Binary(type_, self.c.pick("+-*"), *self._pair(type_, depth))),
            (4, lambda: self._choose(type_, depth, mode)),
            (2 if mode else 0, lambda: self._folded(type_)),
            (5, lambda: self._floor(type_, depth)),
            (2, lambda: self._power(type_, depth)),
            (4, lambda: self._convert(type_, depth)),
            (5, lambda: self._selected(type_, depth)),
            (6, lambda: self._helper(type_, depth, mode)),
            (3, lambda: self._part(type_, depth, mode)),
        ]
        if type_ in FLOATS:
            options += [(6, lambda: t.Binary(type_, "/", *self._pair(type_, depth)))]
            options += [(6, lambda: self._elementary(type_, depth))]
            options += [(12 if self.library else 0, lambda: self._library(type_, depth))]
        else:
            options += [(8, lambda: self._bits(type_, depth)), (5, lambda: self._wrapped(type_, depth))]
        if type_ not in ("u32", "u64"):
            options += [(2, lambda: self._call(self.c.pick(("abs", "sign")), type_, type_, depth))]
        if self._may_reach_outside():
            options += [(8 if type_ == "u32" else 3, lambda: self._reading(type_, depth))]
        options += [(5 if self._externs(type_) else 0, lambda: self.extern(type_, depth))]
        options += [(3, lambda: t.Unary(type_, "-", self.expr(type_, depth - 1)))]
        return self._one_of(options)

    def _call(self, name: str, type_: Type, argument: Type, depth: int) -> t.Expr:
        return t.Call(type_, name, (self.expr(argument, depth - 1),))

    def divisor(self, type_: str, depth: int) -> t.Expr:
        """A divisor: a non-zero literal, a positive value, or (so that it can fault) any value."""
        if type_ in FLOATS:
            return self.expr(type_, depth - 1, FREE)
        one, nine = t.Literal(type_, 1), t.Literal(type_, 9)
        kind = self.c.weighted(((5, "literal"), (1, "opaque"), (1, "max"), (1, "clamp"), (1, "%")))
        found = self.opaque(type_) if kind == "opaque" else None
        if found is not None:
            return found
        if kind == "max":
            return t.Call(type_, "max", (self.expr(type_, depth - 1), one))
        if kind == "clamp":
            return t.Call(type_, "clamp", (self.expr(type_, depth - 1), one, nine))
        if kind == "%":
            return t.Binary(type_, "+", t.Binary(type_, "%", self.expr(type_, depth - 1), nine), one)
        value = self.c.between(1, 9)
        return t.Literal(type_, -value if type_ in SIGNED and self.c.chance(20) else value)

    def _floor(self, type_: str, depth: int) -> t.Expr:
        return t.Binary(type_, self.c.pick(("//", "%")), self.expr(type_, depth - 1), self.divisor(type_, depth))

    def _power(self, type_: str, depth: int) -> t.Expr:
        base = self.expr(type_, depth - 1)
        if type_ in FLOATS and self.c.chance(20):
            return t.Binary(type_, "**", base, self.expr(type_, depth - 1))
        return t.Binary(type_, "**", base, t.Literal("i64", self.c.between(0, 4)))

    def _convert(self, type_: str, depth: int) -> t.Expr:
        source = self.c.pick(NUMBERS)
        safe = type_ in INTEGERS and self.c.chance(60)
        return self._call(f"sat_{type_}" if safe else type_, type_, source, depth)

    def _selected(self, type_: str, depth: int) -> t.Expr:
        name = self.c.pick(("min", "max", "clamp"))
        count = 3 if name == "clamp" else self.c.between(2, 3)
        known = self.c.upto(count - 1)
        args = (self.expr(type_, depth - 1, TYPED if n == known else FREE) for n in range(count))
        return t.Call(type_, name, tuple(args))

    def _elementary(self, type_: str, depth: int) -> t.Expr:
        kind = self.c.weighted(((4, _ONE_FLOAT), (4, oracle.ELEMENTARY_1), (3, _TWO_FLOATS), (1, ("lerp",))))
        name = self.c.pick(kind)
        if name in _TWO_FLOATS:
            return t.Call(type_, name, self._pair(type_, depth))
        if name == "lerp":
            return t.Call(type_, name, (*self._pair(type_, depth), self.expr(type_, depth - 1, FREE)))
        return self._call(name, type_, type_, depth)

    def _bits(self, type_: str, depth: int) -> t.Expr:
        symbols = ["&", "|", "^", "~", ">>", *(["<<"] if type_ not in SIGNED else [])]
        symbol = self.c.pick(symbols)
        if symbol == "~":
            return t.Unary(type_, "~", self.expr(type_, depth - 1))
        if symbol in ("<<", ">>"):
            return t.Binary(type_, symbol, self.expr(type_, depth - 1), self.count(type_, depth))
        return t.Binary(type_, symbol, *self._pair(type_, depth))

    def count(self, type_: str, depth: int) -> t.Expr:
        """A shift count: a literal in range, a value modulo the width, or (so that it can fault) any integer."""
        width = WIDTH[type_]
        if self.c.chance(60):
            return t.Literal("i64", self.c.pick((1, 0, 3, width - 1, width // 2)))
        kind = self.c.pick(INTEGERS)
        found = self.opaque(kind)
        if found is not None and self.c.chance(10):
            return found
        return t.Binary(kind, "%", self.expr(kind, depth - 1), t.Literal(kind, width))

    def _wrapped(self, type_: str, depth: int) -> t.Expr:
        kind = self.c.pick(("wrap", "sat"))
        if self.c.chance(60):
            return t.Call(type_, f"{kind}_{self.c.pick(('add', 'sub', 'mul'))}", self._pair(type_, depth))
        source = self.c.pick(INTEGERS if kind == "wrap" else NUMBERS)
        return self._call(f"{kind}_{type_}", type_, source, depth)

    # ---- any type --------------------------------------------------------------------------------------------------

    def _choose(self, type_: Type, depth: int, mode: int = TYPED) -> t.Expr:
        condition, wordy = self.expr("bool", depth - 1), element(type_) in WORDS
        with self.conditional():
            if mode != TYPED and not wordy and self.c.chance(30):  # literals adopt a type through it
                return t.Choose(type_, condition, self.bare(type_, depth - 1), self.bare(type_, depth - 1))
            if isinstance(type_, str) and (type_ in NUMBERS or wordy and mode == TYPED):
                return t.Choose(type_, condition, *self._pair(type_, depth))
            inner = mode if wordy else TYPED
            return t.Choose(type_, condition, self.expr(type_, depth - 1, inner), self.expr(type_, depth - 1, inner))

    def bare(self, type_: Type, depth: int) -> t.Expr:
        """A literal, or a choice between literals."""
        if depth > 0 and self.c.chance(20):
            return t.Choose(
                type_, self.expr("bool", depth - 1), self.bare(type_, depth - 1), self.bare(type_, depth - 1)
            )
        return self.constant(type_, LITERAL)

    def declared(self, type_: Type) -> t.Expr:
        """An expression with a declared type: a field, an argument, a conversion, or an array of these."""
        if isinstance(type_, Array):
            inner = row(type_)
            return t.ArrayOf(type_, tuple(self.declared(inner) for _ in range(type_.shape[0])))
        fields = [e for e in self.scope.readable() if e.type == type_ and isinstance(e, t.Field)]
        return self.c.pick(fields) if fields else self.constant(type_, TYPED)

    def _folded(self, type_: str) -> t.Expr:
        """An operation on literals, which is again a literal: exact for integers, rounded for floats."""
        a, b = self.constant(type_, LITERAL), self.constant(type_, LITERAL)
        op = self.c.pick("+-*/") if type_ in FLOATS and oracle.literal(b) != 0.0 else self.c.pick("+-*")
        if type_ in FLOATS:
            value = oracle.elementwise(op, type_, oracle.literal(a), oracle.literal(b))
            return t.Literal(type_, float(value), True, f"({a} {op} {b})")
        value = {"+": a.value + b.value, "-": a.value - b.value, "*": a.value * b.value}[op]
        return t.Literal(type_, value, True, f"({a} {op} {b})") if _fits(type_, value, value) else a

    def _helper(self, type_: Type, depth: int, mode: int = TYPED) -> t.Expr:
        fitting = [h for h in self.scope.helpers if h.result == type_]
        if not fitting:
            return self.leaf(type_, mode)
        return self.call(self.c.pick(fitting), depth)

    def _part(self, type_: Type, depth: int, mode: int) -> t.Expr:
        """An element or a member of a helper's result."""
        results = [h for h in self.scope.helpers if not isinstance(h.result, str | Results | None)]
        fitting = [(h, way) for h in results for way, found in ways(h.result) if way and found == type_]
        if not fitting:
            return self.leaf(type_, mode)
        helper, way = self.c.pick(fitting)
        return self.place(self.call(helper, depth), way)

    def call(self, helper: t.Function, depth: int) -> t.Call:
        assert helper.result is not None
        args = tuple(self.expr(k, depth - 1, FREE) for _, k in helper.arguments)
        return t.Call(helper.result, helper.name, args, helper)

    def _library(self, type_: Type, depth: int) -> t.Expr:
        fitting = [s for s in catalog.library() if s.result.bind(type_, {})]
        if not fitting:
            return self.leaf(type_)
        signature = self.c.pick(fitting)
        sizes: dict[str, Any] = {}
        signature.result.bind(type_, sizes)
        for variable in signature.variables:
            least = 2 if signature.name.startswith(("interp", "extrapolate")) else 1
            sizes.setdefault(variable, self.c.between(least, 4))
        for name in signature.elements:
            sizes.setdefault(name, self.c.pick(catalog.ELEMENTS[name]))
        # Few nodes per operand, because an array has many elements.
        args = [self.expr(p.at(sizes), min(depth - 1, 1), TYPED) for p in signature.args]
        if signature.name.startswith(("interp", "extrapolate")):
            points = sum(not p.extents for p in signature.args)
            for i in range(points, 2 * points):
                args[i] = self._breakpoints(args[i])
        return t.Call(type_, signature.name, tuple(args))

    def _breakpoints(self, drawn: t.Expr) -> t.Expr:
        """Literals that ascend, or values that the compiler does not know: others it refuses."""
        type_ = drawn.type
        assert isinstance(type_, Array)
        if self.c.chance(60):
            return t.Call(type_, "max", (drawn, drawn))
        values = [float(self.c.between(-9, 3))]
        for _ in range(type_.shape[0] - 1):
            values.append(values[-1] + self.c.pick((1.0, 0.25, 3.0)))
        return t.ArrayOf(type_, tuple(t.Literal(type_.element, value, False) for value in values))

    # ---- what reaches outside ----------------------------------------------------------------------------------------

    def _may_reach_outside(self) -> bool:
        """Whether external calls are allowed: in execute, and evaluated unconditionally."""
        return self.scope.method == "execute" and not self._conditions

    def _reading(self, type_: str, depth: int) -> t.Expr:
        """A read of the board as this number."""
        found = self.hardware("u32", depth)
        return found if type_ == "u32" else t.Call(type_, type_, (found,))

    def hardware(self, type_: str, depth: int) -> t.Expr:
        """A read of the board."""
        name = "hw_read_gpio" if type_ == "bool" else self.c.pick(("hw_read_u32", "hw_read_adc"))
        return t.Call(type_, name, (self.expr("u32", depth - 1, FREE),))

    def extern(self, type_: Type, depth: int) -> t.Expr:
        """A call of an extern that gives this type."""
        return self.call_of(self.c.pick(self._externs(type_)), depth)

    def call_of(self, extern: t.Extern, depth: int) -> t.Call:
        args = tuple(self.expr(k, depth - 1, FREE) for _, k in extern.arguments)
        return t.Call("bool" if extern.result is None else extern.result, extern.name, args, extern=extern)

    def _externs(self, type_: Type) -> list[t.Extern]:
        """Externs that may be called here."""
        return [e for e in self.scope.externs if e.result == type_] if self._may_reach_outside() else []

    # ---- names of healths and requests -------------------------------------------------------------------------------

    def _word(self, type_: str, depth: int, mode: int) -> t.Expr:
        return self._one_of(
            [
                (8, lambda: self.leaf(type_, mode)),
                (5, lambda: self._choose(type_, depth, mode)),
                (5, lambda: self._helper(type_, depth, mode)),
            ]
        )

    # ---- bools -----------------------------------------------------------------------------------------------------

    def _bool(self, depth: int) -> t.Expr:
        return self._one_of(
            [
                (6, lambda: self.leaf("bool")),
                (16, lambda: self._compare(depth)),
                (6, lambda: self._logic(depth)),
                (3, lambda: t.Unary("bool", "not", self.expr("bool", depth - 1))),
                (2, lambda: self._choose("bool", depth)),
                (
                    2,
                    lambda: self._call(self.c.pick(("isnan", "isfinite", "isinf")), "bool", self.c.pick(FLOATS), depth),
                ),
                (5, lambda: self._same(depth)),
                (2, lambda: self._helper("bool", depth)),
                (4 if self._may_reach_outside() else 0, lambda: self.hardware("bool", depth)),
                (4 if self._externs("bool") else 0, lambda: self.extern("bool", depth)),
            ]
        )

    def _compare(self, depth: int) -> t.Expr:
        """A chain of comparisons. Its ends may adopt the type of their neighbours."""
        type_ = self.c.pick(NUMBERS)
        count = self.c.weighted(((6, 2), (3, 3), (1, 4)))
        free = self.c.pick((count - 1, 0))
        operands = [self.expr(type_, depth - 1, FREE if n == free else TYPED) for n in range(2)]
        with self.conditional():
            operands += [self.expr(type_, depth - 1, FREE if n == free else TYPED) for n in range(2, count)]
        return t.Compare("bool", tuple(self.c.pick(tuple(oracle.COMPARE)) for _ in operands[1:]), tuple(operands))

    def _logic(self, depth: int) -> t.Expr:
        operands = [self.expr("bool", depth - 1)]
        with self.conditional():
            operands += [self.expr("bool", depth - 1) for _ in range(self.c.between(1, 2))]
        return t.Logic("bool", self.c.pick(("and", "or")), tuple(operands))

    def _same(self, depth: int) -> t.Expr:
        """== and != of unordered types. The operand with a type is on either side."""
        words = [k for k in WORDS if self._places(k)]
        if words and self.c.chance(75):
            type_ = self.c.pick(words)
            typed, other = self.expr(type_, depth - 1, TYPED), self.expr(type_, depth - 1, FREE)
            operands: tuple[t.Expr, ...] = (typed, other) if self.c.chance(70) else (other, typed)
            if typed == operands[1] and self.c.chance(20):  # a chain
                with self.conditional():
                    operands = (*operands, self.expr(type_, depth - 1, FREE))
            return t.Compare("bool", tuple(self.c.pick(("==", "!=")) for _ in operands[1:]), operands)
        both = (self.expr("bool", depth - 1), self.expr("bool", depth - 1))
        return t.Compare("bool", (self.c.pick(("==", "!=")),), both)

    # ---- arrays and structs ----------------------------------------------------------------------------------------

    def _array(self, type_: Array, depth: int, mode: int) -> t.Expr:
        inner = type_.element
        options: list[tuple[int, Callable[[], t.Expr]]] = [
            (10, lambda: self.leaf(type_, mode)),
            (6 if size(type_) <= _WRITTEN else 0, lambda: self._written(type_, depth, mode)),
            (3, lambda: self._choose(type_, depth, mode if inner in WORDS else TYPED)),
            (5, lambda: self._helper(type_, depth, mode)),
            (3, lambda: self._part(type_, depth, mode)),
            (8 if self._externs(type_) else 0, lambda: self.extern(type_, depth)),
        ]
        if inner in NUMBERS:
            options += [
                (
                    8,
                    lambda: t.Binary(
                        type_, self.c.pick("+-"), self.expr(type_, depth - 1), self.expr(type_, depth - 1)
                    ),
                ),
                (6, lambda: self.scaled(type_, depth)),
                (14 if depth > 0 else 0, lambda: self._mapped(type_, depth)),
                (3, lambda: t.Unary(type_, "-", self.expr(type_, depth - 1))),
            ]
        if inner in FLOATS and self.library:
            options += [(20, lambda: self._library(type_, depth))]
        return self._one_of(options)

    def _mapped(self, type_: Array, depth: int) -> t.Expr:
        """A function of numbers on arrays, a conversion of one, a choice by a mask, or a product of vectors."""
        inner, shape = str(type_.element), type_.shape

        def array() -> t.Expr:
            return self.expr(type_, min(depth - 1, 1))

        def either() -> t.Expr:
            return array() if self.c.chance(50) else self.expr(inner, min(depth - 1, 1), TYPED)

        kind = self.c.weighted(((3, "select"), (2, "convert"), (3, "where"), (3, "float"), (3, "product")))
        if kind == "convert":
            source = self.c.pick(NUMBERS)
            safe = inner in INTEGERS and self.c.chance(80)
            return t.Call(type_, f"sat_{inner}" if safe else inner, (self.expr(Array(source, shape), 1),))
        if kind == "where":
            low, high = (array(), either()) if self.c.chance(50) else (either(), array())
            mask = t.Compare(Array("bool", shape), (self.c.pick(("<", "<=", ">", ">=", "==", "!=")),), (low, high))
            return t.Call(type_, "where", (mask, either(), either()))
        if kind == "float" and inner in FLOATS:
            name = self.c.pick((*_ONE_FLOAT, *oracle.ELEMENTARY_1, *_TWO_FLOATS, "abs", "lerp"))
            count = 3 if name == "lerp" else 2 if name in _TWO_FLOATS else 1
            return t.Call(type_, name, (array(), *(either() for _ in range(count - 1))))
        if kind == "product" and len(shape) == 1:
            ops = "*/" if inner in FLOATS else "*"
            left = either() if inner in FLOATS else array()
            return t.Binary(type_, self.c.pick(ops), left, array())
        name = self.c.pick(("min", "max", "clamp"))
        return t.Call(type_, name, (array(), *(either() for _ in range(2 if name == "clamp" else 1))))

    def scaled(self, type_: Array, depth: int) -> t.Expr:
        """Array and scalar, in either order."""
        array, factor = self.expr(type_, depth - 1), self.expr(type_.element, depth - 1, FREE)
        if type_.element in FLOATS and self.c.chance(40):
            return t.Binary(type_, "/", array, factor)
        return t.Binary(type_, "*", *((factor, array) if self.c.chance(50) else (array, factor)))

    def _written(self, type_: Array | Struct, depth: int, mode: int) -> t.Expr:
        """[a, b], Pose(a, b). The first item of an array has a type unless the context gives one."""
        if isinstance(type_, Struct):
            return self._struct_of(type_, depth)
        inner = row(type_)
        if type_.element == "f64" and self.c.chance(20):
            square = len(type_.shape) == 2 and type_.shape[0] == type_.shape[1]
            sizes = tuple(t.Literal("i64", n) for n in type_.shape)
            return t.Call(type_, "eye", sizes[:1]) if square and self.c.chance(50) else t.Call(type_, "zeros", sizes)
        if isinstance(inner, Array):
            return t.ArrayOf(type_, tuple(self._written(inner, depth, mode) for _ in range(type_.shape[0])))
        known = TYPED if mode == TYPED else LITERAL
        modes = [known, *[LITERAL] * (type_.shape[0] - 1)]
        return t.ArrayOf(type_, tuple(self.expr(inner, depth - 1, m) for m in modes))

    def _struct(self, type_: Struct, depth: int) -> t.Expr:
        return self._one_of(
            [
                (8, lambda: self.leaf(type_)),
                (6, lambda: self._struct_of(type_, depth)),
                (3, lambda: self._choose(type_, depth)),
                (5, lambda: self._helper(type_, depth)),
                (8 if self._externs(type_) else 0, lambda: self.extern(type_, depth)),
            ]
        )

    def _struct_of(self, type_: Struct, depth: int) -> t.Expr:
        args = [(n, self.expr(k, depth - 1, FREE)) for n, k in type_.members]
        keywords = self.c.chance(40)
        if keywords and self.c.chance(50):
            args.reverse()
        return t.StructOf(type_, tuple(args), keywords)


def _finite_in(type_: Type, value: float) -> bool:
    """Whether a float literal is within the range of this float type."""
    return type_ == "f64" or (type_ == "f32" and (not math.isfinite(value) or math.isfinite(single(value))))


def _fits(type_: Type, low: int, high: int) -> bool:
    return type_ in INTEGERS and RANGE[str(type_)][0] <= low and high <= RANGE[str(type_)][1]
