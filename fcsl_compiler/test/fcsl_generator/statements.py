# SPDX-License-Identifier: Apache-2.0
"""Generates function bodies: all statements of the language, with definite assignment by construction."""

from __future__ import annotations

from collections.abc import Callable

from . import tree as t
from .choices import Choices
from .expressions import FREE, LITERAL, TYPED, Expressions
from .places import Scope, Step, ways
from .types import (
    FLOATS,
    HEALTH,
    INTEGERS,
    NUMBERS,
    REQUEST,
    REQUESTS,
    SIGNED,
    Array,
    Results,
    Type,
    row,
    size,
)

_DEPTH = 3  # of an expression

#: Functions that can be called as statements, and their argument types.
_WRITES: tuple[tuple[str, tuple[Type, ...]], ...] = (
    ("hw_write_gpio", ("u32", "bool")),
    ("hw_write_u32", ("u32", "u32")),
)


class Statements:
    """Generates statements. `palette`: types for locals."""

    def __init__(self, choices: Choices, scope: Scope, palette: tuple[Type, ...], fuel: int, library: bool):
        self.c, self.scope, self.palette = choices, scope, palette
        self.e = Expressions(choices, scope, fuel, library)
        self._loops = self._events = 0
        self._pending: list[t.Stmt] = []  # statements that determine the types of new locals with literals

    def body(self, most: int) -> t.Block:
        """A whole body. The body of a helper ends with its result."""
        block, ended = self.block(2, most)
        if self.scope.result is None or ended:
            return block
        return (*block, t.Jump("return", self._result(_DEPTH)))

    def _result(self, depth: int) -> t.Expr | None:
        """The result of a helper."""
        result = self.scope.result
        if isinstance(result, Results):
            same = [h for h in self.scope.helpers if h.result == result]
            if same and self.c.chance(30):
                return self.e.call(self.c.pick(same), depth)
            return t.ResultsOf(result, tuple(self.e.expr(k, depth - 1, FREE) for k in result.types))
        return None if result is None else self.e.expr(result, depth, FREE)

    def block(self, nesting: int, most: int) -> tuple[t.Block, bool]:
        """Statements of a block, and whether control never reaches its end."""
        out: list[t.Stmt] = []
        for _ in range(most):
            if out and not self.c.chance(88):
                break
            statement, ended = self._statement(nesting)
            out.append(statement)
            if ended:
                return tuple(out), True
            out += self._pending
            self._pending = []
        return tuple(out), False

    def _statement(self, nesting: int) -> tuple[t.Stmt, bool]:
        s = self.scope
        nested = nesting > 0 and self.e.fuel > 0
        options: list[tuple[int, Callable[[], tuple[t.Stmt, bool]]]] = [
            (20 if s.writable() else 0, lambda: (self._assign(), False)),
            (10, lambda: (self._bind(), False)),
            (8 if s.writable() else 0, lambda: (self._augmented(), False)),
            (5, lambda: (self._unpack(), False)),
            (8 if self._rows() else 0, lambda: (self._overlap(), False)),
            (8 if nested else 0, lambda: self._if(nesting)),
            (7 if nested else 0, lambda: (self._for(nesting), False)),
            (4 if s.method == "execute" else 0, lambda: (self._health(), False)),
            (3 if s.method == "execute" else 0, lambda: (self._hardware(), False)),
            (8 if s.externs and s.method == "execute" else 0, lambda: (self._extern(), False)),
            (4 if s.method == "execute" else 0, lambda: (self._event(), False)),
            (8 if self._request_field() else 0, lambda: (self._request(), False)),
            (6 if s.loops and nesting < 2 else 0, self._jump),
            (3 if nesting < 2 else 0, self._return),
        ]
        return self.c.weighted(options)()

    # ---- places ----------------------------------------------------------------------------------------------------

    def _place(self) -> t.Expr:
        """A writable root, or a part of it."""
        writable = self.scope.writable()
        fields = [e for e in writable if isinstance(e, t.Field)]  # values stored in fields are visible
        root = self.c.pick(fields if fields and self.c.chance(60) else writable)
        way, _ = self.c.pick(ways(root.type)) if self.c.chance(55) else ways(root.type)[0]
        return self.e.place(root, way)

    def _fresh(self, type_: Type) -> t.Name:
        name = f"v{len(self.scope.locals_)}"
        self.scope.locals_[name] = type_
        self.scope.assigned.add(name)
        return t.Name(type_, name)

    def _assign(self) -> t.Stmt:
        place = self._place()
        self.e.target = t.root(place)
        value = self.e.expr(place.type, _DEPTH, FREE)
        self.e.target = None
        return t.Assign(place, value)

    def _rows(self) -> list[t.Expr]:
        return [e for e in self.scope.writable() if isinstance(e.type, Array) and e.type.shape[0] > 2]

    def _overlap(self) -> t.Stmt:
        """x[1:4] = x[0:3] + …: source and target overlap."""
        c, array = self.c, self.c.pick(self._rows())
        assert isinstance(array.type, Array)
        rows = array.type.shape[0]
        step = Step(dimensions=(rows - 1 - c.upto((rows - 1) // 2),))
        target, value = self.e.place(array, (step,)), self.e.place(array, (step,))
        type_ = target.type
        if isinstance(type_, Array) and type_.element in NUMBERS and c.chance(70):
            other = self.e.place(array, (step,)) if c.chance(50) else self.e.expr(type_, 2)
            value = t.Binary(type_, c.pick("+-"), value, other)
        if not t.reaches_outside(value) and c.chance(20):
            value = t.Choose(type_, self.e.expr("bool", 2), value, self.e.place(array, (step,)))
        return t.Assign(target, value)

    def _hardware(self) -> t.Stmt:
        """A call as a statement: a write, or a read whose result is stored."""
        if self.c.chance(50):
            value = self.e.hardware(self.c.pick(("u32", "bool")), 2)
            return t.Assign(self._target(value.type), value)
        name, args = self.c.pick(_WRITES)
        return t.Perform(t.Call("bool", name, tuple(self.e.expr(k, 2, FREE) for k in args)))

    def _event(self) -> t.Stmt:
        c, kinds = self.c, [k for k in (*NUMBERS, "bool", HEALTH) if self.e.knows(k)]
        values = tuple(self.e.expr(c.pick(kinds), 2, TYPED) for _ in range(c.upto(4)))
        self._events += 1
        return t.Event(f"e{self._events}", values, c.pick(("", "debug", "info", "warning", "error")))

    def _extern(self) -> t.Stmt:
        """A call as a statement. A result, if any, is stored."""
        call = self.e.call_of(self.c.pick(self.scope.externs), 3)
        assert call.extern is not None
        return t.Perform(call) if call.extern.result is None else t.Assign(self._target(call.type), call)

    def _bind(self) -> t.Stmt:
        """A new local, or one that another path has defined."""
        s = self.scope
        waiting = [n for n in s.locals_ if n not in s.assigned]
        if waiting and self.c.chance(60):
            name = self.c.pick(waiting)
            value = self.e.expr(s.locals_[name], _DEPTH, FREE)
            s.assigned.add(name)
            return t.Assign(t.Name(s.locals_[name], name), value)
        type_ = self.c.pick(self.palette)
        if self.c.chance(30) or not self.e.knows(type_):
            value = self.e.expr(type_, _DEPTH, FREE)
            return t.Assign(self._fresh(type_), value, declared=True, quoted=not self.c.chance(30))
        if type_ in NUMBERS and self.c.chance(20):
            return self._begin(type_, self.e.bare(type_, 1))
        if isinstance(type_, Array) and type_.element in NUMBERS and size(type_) <= 12 and self.c.chance(20):
            return self._begin(type_, self._literals(type_))
        value = self.e.expr(type_, _DEPTH, TYPED)
        return t.Assign(self._fresh(type_), value)

    def _begin(self, type_: Type, value: t.Expr) -> t.Stmt:
        """A local with untyped literals. The next statement determines its type."""
        name = self._fresh(type_)
        places = [e for e in self.scope.writable() if e.type == type_ and isinstance(e, t.Field)]
        kind = self.c.upto(2)
        if kind == 0 and places:
            self._pending.append(t.Assign(self.c.pick(places), name))
        elif kind == 1 and type_ in NUMBERS:
            self._pending.append(t.Assign(name, self.e.declared(type_), self.c.pick("+-*")))
        else:
            self._pending.append(t.Assign(name, self.e.declared(type_)))
        return t.Assign(name, value)

    def _literals(self, type_: Type) -> t.Expr:
        """[[1, 2], [3, 4]]: untyped literals only."""
        if isinstance(type_, Array):
            return t.ArrayOf(type_, tuple(self._literals(row(type_)) for _ in range(type_.shape[0])))
        return self.e.constant(type_, LITERAL)

    def _augmented(self) -> t.Stmt:
        place = self._place()
        type_, c, e = place.type, self.c, self.e
        if isinstance(type_, Array) and type_.element in NUMBERS:
            if c.chance(50):
                return t.Assign(place, e.expr(type_, 2), c.pick("+-"))
            symbol = "/" if type_.element in FLOATS and c.chance(40) else "*"
            return t.Assign(place, e.expr(type_.element, 2, FREE), symbol)
        if type_ not in NUMBERS:
            return t.Assign(place, e.expr(type_, _DEPTH, FREE))
        assert isinstance(type_, str)
        symbols = ["+", "-", "*", "//", "%", *(["/"] if type_ in FLOATS else ["&", "|", "^", ">>"])]
        symbol = c.pick([*symbols, *(["<<"] if type_ in INTEGERS and type_ not in SIGNED else [])])
        if symbol in ("//", "%"):
            return t.Assign(place, e.divisor(type_, 2), symbol)
        return t.Assign(place, e.count(type_, 2) if symbol in ("<<", ">>") else e.expr(type_, 2, FREE), symbol)

    def _unpack(self) -> t.Stmt:
        """Several values to several places, or the rows of an array."""
        c, s = self.c, self.scope
        several = [h for h in s.helpers if isinstance(h.result, Results)]
        if several and c.chance(50):
            helper = c.pick(several)
            assert isinstance(helper.result, Results)
            value = self.e.call(helper, 2)
            return t.Unpack(tuple(self._target(k) for k in helper.result.types), (value,))
        arrays = [k for k in self.palette if isinstance(k, Array) and 2 <= k.shape[0] <= 4]
        array = c.pick(arrays) if arrays and c.chance(40) else None
        found = None
        if array:  # with or without a name
            known = self.e.knows(array) and c.chance(40)
            found = self.e.expr(array, 2) if known else self.e.named(array)
        if array and found and not isinstance(found, t.ArrayOf):  # its elements are separate values
            value = found
            return t.Unpack(tuple(self._target(row(array)) for _ in range(array.shape[0])), (value,))
        places = [self._place() for _ in range(c.between(2, 3))] if s.writable() else []
        if places and c.chance(60):  # also swaps and rotations
            values = [self.e.expr(p.type, 2, FREE) for p in places]
            return t.Unpack(tuple(places), tuple(values))
        known = [k for k in self.palette if self.e.knows(k)] or ["f64"]
        types = [c.pick(known) for _ in range(c.between(2, 3))]
        values = [self.e.expr(k, 2, TYPED) for k in types]
        return t.Unpack(tuple(self._target(k) for k in types), tuple(values))

    def _target(self, type_: Type) -> t.Expr:
        fitting = [e for e in self.scope.writable() if e.type == type_]
        return self.c.pick(fitting) if fitting and self.c.chance(50) else self._fresh(type_)

    def _health(self) -> t.Stmt:
        words = [t.Word(HEALTH, w) for w in ("degraded", "failed", "nominal")]
        value: t.Expr = self.c.pick(words)
        if self.c.chance(40):
            value = self.e.expr(HEALTH, 2, FREE)
        elif self.c.chance(60):
            value = t.Choose(HEALTH, self.e.expr("bool", 2), value, self.c.pick(words))
        value = words[0] if self._is_stale(value) else value
        return t.Assign(t.Field(HEALTH, "outputs", "health"), value)

    def _is_stale(self, value: t.Expr) -> bool:
        """Whether the text itself assigns "stale" to a running algorithm, which is an error."""
        if isinstance(value, t.Choose):
            return self._is_stale(value.then) or self._is_stale(value.otherwise)
        constant = isinstance(value, t.Name) and value.constant
        return constant or (isinstance(value, t.Word) and value.word == "stale")

    def _request_field(self) -> t.Field | None:
        return next((f for f in self.scope.fields if f.name == "transition_request"), None)

    def _request(self) -> t.Stmt:
        field = self._request_field()
        assert field is not None
        value: t.Expr = t.Word(REQUEST, self.c.pick(REQUESTS))
        if self.c.chance(50):
            condition = self.e.expr("bool", 2)
            with self.e.conditional():
                value = t.Choose(REQUEST, condition, value, self.e.expr(REQUEST, 1, FREE))
        return t.Assign(field, value)

    # ---- control flow ----------------------------------------------------------------------------------------------

    def _if(self, nesting: int) -> tuple[t.Stmt, bool]:
        s, before = self.scope, set(self.scope.assigned)
        branches: list[tuple[t.Expr | None, t.Block]] = []
        after: list[set[str]] = []  # assigned names at the end of each path that continues
        count = self.c.weighted(((5, 1), (2, 2)))
        has_else = self.c.chance(60)
        for n in range(count + has_else):
            s.assigned = set(before)
            condition = None if n == count else self.e.expr("bool", _DEPTH)
            block, ended = self.block(nesting - 1, 3)
            branches.append((condition, block))
            if not ended:
                after.append(s.assigned)
        if not has_else:
            after.append(before)
        s.assigned = set.intersection(*after) if after else before
        return t.If(tuple(branches)), not after

    def _for(self, nesting: int) -> t.Stmt:
        s = self.scope
        args, low, high, always = self._range()
        name = f"i{self._loops}"
        self._loops += 1
        before, jumped = set(s.assigned), s.jumped
        s.loops[name], s.jumped = (low, high), False
        block, _ = self.block(nesting - 1, 3)
        del s.loops[name]
        if not always or s.jumped:
            s.assigned = before
        s.jumped = jumped
        return t.For(name, args, block)

    def _range(self) -> tuple[tuple[t.Expr, ...], int, int, bool]:
        """Arguments of range, the bounds of its variable, and whether it runs at least once."""
        c, n = self.c, self.c.between(1, 4)
        outer = [(v, low, high) for v, (low, high) in self.scope.loops.items()]
        if outer and c.chance(40):  # a triangular loop
            v, low, high = c.pick(outer)
            variable = t.LoopVar("i64", v)
            if c.chance(50) and high >= 1:
                return (variable,), 0, high - 1, False
            above = high + c.between(1, 2)
            if c.chance(30) and high >= 0:
                return (t.Binary("i64", "+", variable, t.Literal("i64", 1)),), 0, high, False
            return (variable, t.Literal("i64", above)), low, above - 1, False
        kind = c.upto(3)
        if kind == 1:
            first = c.between(-2, 2)
            return (t.Literal("i64", first), t.Literal("i64", first + n)), first, first + n - 1, True
        if kind == 2:
            return tuple(t.Literal("i64", v) for v in (n, -1, -1)), 0, n, True
        if kind == 3:
            return tuple(t.Literal("i64", v) for v in (1, n + 2, 2)), 1, n + 1, True
        sizes = [k for k in self.scope.bare("i64") if 1 <= k.value <= 4]
        if sizes and c.chance(50):
            size = c.pick(sizes)
            return (size,), 0, size.value - 1, True
        return (t.Literal("i64", n),), 0, n - 1, True

    def _jump(self) -> tuple[t.Stmt, bool]:
        self.scope.jumped = True
        return t.Jump(self.c.pick(("break", "continue"))), True

    def _return(self) -> tuple[t.Stmt, bool]:
        self.scope.jumped = True
        return t.Jump("return", self._result(2)), True
