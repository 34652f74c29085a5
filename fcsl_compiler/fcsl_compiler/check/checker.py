# SPDX-License-Identifier: Apache-2.0
"""Base of the expression checker: reporting, conversion of strings, the op table."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import NoReturn

from ..base.diagnostics import DiagnosticSink, nearest
from ..base.source import Span
from ..model import ir, ops
from ..model.literals import STRING_LITERAL
from ..model.types import BOOL, HEALTH, HEALTH_NAMES, REQUEST, SCALARS, Array, Results, Scalar, Type
from ..parse.python_source import span_of
from .folding import DoesNotFit, fold
from .inference import Inference
from .intervals import exact, fits, interval
from .scope import Scope


class Stop(Exception):
    """The current statement cannot be checked further. The reason has been reported."""


class Checker:
    """Methods return typed IR or raise Stop."""

    def __init__(self, scope: Scope, sink: DiagnosticSink):
        self.scope, self.sink = scope, sink
        self.inference = Inference(scope)
        self._shared = 0
        self._conditions = 0  # number of enclosing conditions that decide whether the current expression is evaluated

    # ---- reporting and coercion ------------------------------------------------------------------------------------

    def fail(
        self,
        code: str,
        message: str,
        span: Span,
        *,
        why: str = "",
        help: str = "",
        notes: tuple[tuple[Span, str], ...] = (),
    ) -> NoReturn:
        self.sink.error(code, message, span, why=why, help=help, notes=notes)
        raise Stop

    @contextmanager
    def conditional(self) -> Iterator[None]:
        """Context of an expression that is evaluated only on a condition."""
        self._conditions += 1
        try:
            yield
        finally:
            self._conditions -= 1

    def span(self, node: ast.expr | ast.stmt | ast.keyword) -> Span:
        return span_of(self.scope.source, node)

    def settle(self, expr: ir.Expr, want: Type | None) -> ir.Expr:
        """Converts a string to the request or health that its context expects. Returns other expressions unchanged."""
        return self._word(expr, want) if expr.type is STRING_LITERAL else expr

    def _word(self, expr: ir.Expr, want: Type | None) -> ir.Expr:
        """Converts a string, or a choice between strings, to a request or a health."""
        if want not in (REQUEST, HEALTH):
            beside = f", and the context requires {want}" if want is not None else ""
            why = f"a string is the name of a request or of a health{beside}"
            kind = "Health" if getattr(expr, "value", "") in HEALTH_NAMES else "TransitionRequest"
            fix = f"declare the type of the local: `word: {kind} = …`" if want is None else ""
            self.fail("E440", "a string without a type", expr.span, why=why, help=fix)
        if isinstance(expr, ir.Choose):
            then, otherwise = self._word(expr.then, want), self._word(expr.otherwise, want)
            return ir.Choose(then.type, expr.condition, then, otherwise, expr.span)
        assert isinstance(expr, ir.Const) and isinstance(expr.value, str)
        word = expr.value
        if want == REQUEST:
            if word:
                self.scope.requests.setdefault(word, expr.span)
            return ir.Const(REQUEST, word, expr.span)
        if word not in HEALTH_NAMES:
            words = HEALTH_NAMES[:3] if nearest(word, HEALTH_NAMES[:3]) else HEALTH_NAMES
            fix = nearest(word, words) or f"one of {', '.join(HEALTH_NAMES)}"
            self.fail("E407", f"`{word[:40]}` is not a health", expr.span, help=fix)
        return ir.Const(HEALTH, HEALTH_NAMES.index(word), expr.span)

    def not_a_string(self, operand: ir.Expr) -> ir.Expr:
        """Checks the operand of an operator or conversion that does not accept strings."""
        if operand.type is STRING_LITERAL:
            why = "a string is the name of a request or of a health, which can only be compared"
            self.fail("E440", "a string in an operation", operand.span, why=why)
        return operand

    def check(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """Checks an expression. `want` only decides the meaning of strings; the caller compares types."""
        return self.settle(self.raw(node, want), want)

    def expect(self, node: ast.expr, want: Type, what: str) -> ir.Expr:
        """Checks an expression that must have exactly the type `want`."""
        expr = self.check(node, want)
        if expr.type != want:
            self.mismatch(expr, want, what)
        return expr

    def mismatch(self, expr: ir.Expr, want: Type, what: str, notes: tuple[tuple[Span, str], ...] = ()) -> NoReturn:
        have = expr.type
        fix = ""
        if isinstance(have, Scalar) and isinstance(want, Scalar) and have.is_number and want.is_number:
            fix = f"convert: {want}(…)"
        elif want is BOOL and is_mask(have):
            fix = "write `all(…)` or `any(…)`"
        elif want is BOOL:
            other = "0" if have not in (HEALTH, REQUEST) else '"failed"' if have == HEALTH else '""'
            fix = f"write a comparison, such as `x != {other}`"
        elif want in (HEALTH, REQUEST) and have not in (HEALTH, REQUEST):
            fix = (
                'a health is "nominal", "degraded" or "failed"'
                if want == HEALTH
                else 'a request is its name; none is `""`'
            )
        elif isinstance(have, Scalar) and have is BOOL:
            fix = f"write `{_one(want)} if … else {_zero(want)}`" if isinstance(want, Scalar) and want.is_number else ""
        elif isinstance(have, Results):
            fix = "unpack it, one name for each result"
        elif isinstance(want, Results):
            fix = f"write {len(want.members)} values"
        elif isinstance(have, Array) and isinstance(want, Array):
            fix = "the shapes and element types must be the same"
        elif isinstance(want, Array):
            fix = (
                f"write `zeros({', '.join(map(str, want.shape))})` or `[…]`"
                if getattr(want.element, "is_number", False)
                else "write `[…]`"
            )
        why = "types never mix implicitly" if isinstance(have, Scalar) and isinstance(want, Scalar) else ""
        self.fail(
            "E402", f"{what} is {want}, not {have}", expr.span, why=why, help=fix, notes=(*notes, *self.origin(expr))
        )

    def is_known(self, name: str) -> bool:
        """Whether a name is defined in this function, including names with a reported error."""
        s = self.scope
        return any(
            name in names for names in (s.types, s.arguments, s.constants, s.poisoned, s.wrong, s.ranges, s.dead_ranges)
        ) or (name == "self" and s.algorithm is not None)

    def origin(self, expr: ir.Expr) -> tuple[tuple[Span, str], ...]:
        """A note on where a named value got its type."""
        root = expr
        while isinstance(root, ir.Element | ir.Slice | ir.Member):
            root = root.base
        if isinstance(root, ir.Local) and root.name in self.scope.types and root.name.isidentifier():
            return self.local_origin(root.name)
        if isinstance(root, ir.Field):
            found = self.scope.algorithm.find(root.name) if self.scope.algorithm is not None else None
            assert found is not None
            port = found[1]
            automatic = port.span.column == port.span.end_column  # health and transition_request have no line in a file
            return () if automatic else ((port.span, f"`{root.name}` is declared {root.type} here"),)
        return ()

    def local_origin(self, name: str) -> tuple[tuple[Span, str], ...]:
        """A note on where a local got its type."""
        type_, at = self.scope.types[name]
        because = self.because(name, at) if isinstance(type_, Scalar) else ()
        return because or ((at, f"`{name}` became {type_} here"),)

    def because(self, of: str | ast.expr, at: Span) -> tuple[tuple[Span, str], ...]:
        """A note on what gave a local or a literal its type, if that is on another line."""
        reason = self.inference.reason(of)
        if not isinstance(reason, ast.expr | ast.stmt) or reason.lineno == at.line:
            return ()
        type_ = self.scope.types[of][0] if isinstance(of, str) else self.inference.literal_type(of)
        shown = f"`{of}`" if isinstance(of, str) else "the literal"
        return ((self.span(reason), f"{shown} is {type_} because of this"),)

    def folded(self, expr: ir.Expr) -> ir.Expr:
        """Folds an expression into a constant where possible."""
        try:
            return fold(expr)
        except DoesNotFit as error:
            self.fail("E401", str(error), expr.span, help="use a wider type")

    def part_of(self, base: ir.Expr, part: Callable[[ir.Place], ir.Place], span: Span) -> ir.Expr:
        """A part of a value. A value without a name is first evaluated once into a hidden local."""
        if isinstance(base, ir.Place):
            return part(base)
        if isinstance(base, ir.Let) and isinstance(base.body, ir.Place):
            body = part(base.body)
            return replace(base, type=body.type, body=body, span=span)
        local = self.shared(base)
        body = part(local)
        return ir.Let(body.type, local.name, base, body, span)

    def shared(self, value: ir.Expr) -> ir.Local:
        """A new hidden local for this value, bound by an ir.Let."""
        self._shared += 1
        return ir.Local(value.type, f"shared.{self._shared}", value.span)

    def elementwise(self, name: str, args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ir.Expr:
        """An operation, applied element by element if an operand is an array."""
        raise NotImplementedError

    def raw(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """Like `check`, but a string keeps its type STRING_LITERAL."""
        raise NotImplementedError

    # ---- operations of the op table ----------------------------------------------------------------------------------

    def meet(self, left: ir.Expr, right: ir.Expr) -> tuple[ir.Expr, ir.Expr]:
        """Gives a string the type of the other operand."""
        if left.type is STRING_LITERAL and right.type is STRING_LITERAL:
            why = "a string is the name of a request or of a health; the context must determine which"
            fix = "compare it with a field"
            self.fail("E440", "a string without a type", left.span, why=why, help=fix)
        return self.settle(left, right.type), self.settle(right, left.type)

    def find(self, name: str, scalars: tuple[Type, ...], args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ops.Op:
        op = ops.find(name, tuple(s for s in scalars if isinstance(s, Scalar)))
        if op is None:
            self._no_such_operation(symbol, args, span)
        return op

    def apply(self, name: str, args: tuple[ir.Expr, ...], span: Span, symbol: str = "") -> ir.Expr:
        """Applies one operation of the op table to settled scalars."""
        op = self.find(name, tuple(a.type for a in args), args, symbol or name, span)
        fault = bool(op.faults) and not self._cannot_fault(op, args, span)
        self.scope.faults = self.scope.faults or fault
        return ir.Apply(op.result, op, args, fault, span)

    def _cannot_fault(self, op: ops.Op, args: tuple[ir.Expr, ...], span: Span) -> bool:
        """Whether the operands' bounds prove that the operation cannot fault. Reports an operation that always
        faults."""
        if op.name in ("<<", ">>"):
            width, count = op.args[0].size * 8, interval(args[1])
            if count and (count[1] < 0 or count[0] >= width):
                why = f"a shift of {op.args[0]} moves 0 to {width - 1} bits"
                self.fail("E439", f"the shift count is outside [0, {width})", args[1].span, why=why)
            return count is not None and 0 <= count[0] and count[1] < width
        bounds = exact(op, args)
        divisor = interval(args[1]) if op.name in ("//", "%") else None
        if divisor == (0, 0):
            self.fail("E414", "division by zero", span, help="the divisor is a constant zero")
        return bool((bounds and fits(op, bounds)) or (divisor and divisor[0] > 0))

    def _no_such_operation(self, symbol: str, args: tuple[ir.Expr, ...], span: Span) -> NoReturn:
        if symbol in ("<<", ">>") and isinstance(args[-1].type, Scalar) and args[-1].type.is_integer:
            args = args[:1]  # a shift count may have any integer type
        types = [a.type for a in args]
        if len(types) == 1 and symbol in SCALARS and is_mask(types[0]):
            fix = f"write `where(mask, {_one(SCALARS[symbol])}, {_zero(SCALARS[symbol])})`"
            self.fail(
                "E415", f"no `{symbol}` of {types[0]}", span, why="a bool has no arithmetic and no order", help=fix
            )
        scalars = [t for t in types if isinstance(t, Scalar)]
        fix, why = "", ""
        if symbol == "/" and all(t.is_integer for t in scalars) and len(scalars) == 2:
            fix = "write `//` for the floor, or f64(a) / f64(b)"
            why = "`/` is for floats only"
        elif symbol in ("<<", ">>", "&", "|", "^", "~"):
            fix = _bits_hint(symbol, types)
            why = "bits belong to integers of one type" if symbol in "&|^~" else ""
        elif REQUEST in scalars or HEALTH in scalars:
            why = "requests and healths have no arithmetic and no order"
            fix = "compare with `==` or `!=`"
        elif BOOL in scalars:
            is_number = symbol in SCALARS or len(set(scalars)) > 1 or symbol in "+-*/"
            one, zero = ("1", "0") if symbol in SCALARS and SCALARS[symbol].is_integer else ("1.0", "0.0")
            fix = f"write `{one} if condition else {zero}`" if is_number else ""
            fix = fix or ("write `not x`" if len(types) == 1 else "")
            why = "a bool has no arithmetic and no order"
        elif len(set(types)) > 1:
            if len(scalars) == len(types):
                fix = f"convert one side: {types[0]}(…) or {types[1]}(…)"
            why = "types never mix implicitly"
        listed = " and ".join(map(str, types))
        notes = (
            [n for a in args for n in ((a.span, f"this is {a.type}"), *self.origin(a))] if len(set(types)) > 1 else []
        )
        verb = "between" if len(args) > 1 else "of"
        self.fail("E415", f"no `{symbol}` {verb} {listed}", span, why=why, help=fix, notes=tuple(notes))


def is_mask(type_: Type) -> bool:
    return isinstance(type_, Array) and type_.element is BOOL


def _one(type_: Type) -> str:
    return "1.0" if isinstance(type_, Scalar) and type_.is_float else "1"


def _zero(type_: Type) -> str:
    return "0.0" if isinstance(type_, Scalar) and type_.is_float else "0"


def _bits_hint(symbol: str, types: list[Type]) -> str:
    if BOOL in types:
        return {"&": "write `and`", "|": "write `or`", "^": "write `!=`", "~": "write `not`"}.get(symbol, "")
    if symbol == "<<" and isinstance(types[0], Scalar) and types[0].is_signed:
        return "`<<` is for unsigned numbers: convert with u32(…) or u64(…), or multiply"
    if len(set(types)) > 1 and symbol in "&|^":
        return f"convert one side: {types[0]}(…) or {types[1]}(…)"
    return "convert: u32(…)"
