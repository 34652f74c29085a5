# SPDX-License-Identifier: Apache-2.0
"""What every part of the expression checker shares: reporting, literals that adopt a type, the op table."""

from __future__ import annotations

import ast
from typing import NoReturn

from . import ir, ops
from .diagnostics import DiagnosticSink
from .intervals import exact, fits, interval
from .literals import FLOAT_LITERAL, LiteralError, default_type, fit, is_literal
from .pysource import span_of
from .scope import Scope
from .source import Span
from .types import BOOL, F64, I64, Array, Scalar, Type, element_of


class Stop(Exception):
    """This statement cannot be checked further; the reason has been reported."""


class Checker:
    """Methods return typed IR or raise Stop."""

    def __init__(self, scope: Scope, sink: DiagnosticSink):
        self.scope, self.sink = scope, sink
        self._shared = 0

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

    def span(self, node: ast.expr | ast.stmt | ast.keyword) -> Span:
        return span_of(self.scope.source, node)

    def settle(self, expr: ir.Expr, want: Type | None) -> ir.Expr:
        """Gives a literal its type: the wanted one when it is a number, else i64 or f64."""
        if isinstance(expr, ir.Choose) and is_literal(expr.type):
            assert isinstance(expr.type, Scalar)
            target = want if isinstance(want, Scalar) and want.is_number else default_type(expr.type)
            then, otherwise = self.settle(expr.then, target), self.settle(expr.otherwise, target)
            return ir.Choose(target, expr.condition, then, otherwise, expr.span)
        if isinstance(expr, ir.Const) and is_literal(expr.type):
            assert isinstance(expr.type, Scalar) and isinstance(expr.value, int | float)
            target = want if isinstance(want, Scalar) and want.is_number else default_type(expr.type)
            try:
                return ir.Const(target, fit(expr.value, expr.type, target), expr.span)
            except LiteralError as error:
                self.fail("E401", str(error.args[0]), expr.span, help=str(error.args[1]))
        if isinstance(want, Scalar) and want.is_integer and want != expr.type and isinstance(expr, ir.RangeVar):
            if want.low <= expr.low and expr.high <= want.high:
                op = ops.find(want.name, (I64,))
                assert op
                return ir.Apply(want, op, (expr,), False, expr.span)
        return expr

    def check(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """A settled expression; `want` only guides literals, the caller compares types."""
        return self.settle(self.raw(node, want), want)

    def expect(self, node: ast.expr, want: Type, what: str) -> ir.Expr:
        """An expression of exactly this type."""
        expr = self.check(node, want)
        if expr.type != want:
            self.mismatch(expr, want, what)
        return expr

    def mismatch(
        self, expr: ir.Expr, want: Type, what: str, notes: tuple[tuple[Span, str], ...] = (), remedy: str = ""
    ) -> NoReturn:
        have = expr.type
        fix = ""
        if isinstance(have, Scalar) and isinstance(want, Scalar) and have.is_number and want.is_number:
            fix = f"convert: {want}(…)"
        elif want is BOOL:
            fix = "write a comparison, such as `x != 0`"
        elif isinstance(have, Scalar) and have is BOOL:
            fix = f"write `{_one(want)} if … else {_zero(want)}`" if isinstance(want, Scalar) and want.is_number else ""
        elif isinstance(have, Array) and isinstance(want, Array):
            fix = "the shapes and element types must be the same"
        elif isinstance(want, Array):
            fix = f"write `zeros({', '.join(map(str, want.shape))})` or `[…]`" if want.element is F64 else "write `[…]`"
        fix = remedy or self._begin(expr, want) or fix
        why = "types never mix implicitly" if isinstance(have, Scalar) and isinstance(want, Scalar) else ""
        self.fail(
            "E402", f"{what} is {want}, not {have}", expr.span, why=why, help=fix, notes=(*notes, *self.origin(expr))
        )

    def _begin(self, expr: ir.Expr, want: Type) -> str:
        """The remedy where a local has its type from a bare literal."""
        if not (
            isinstance(expr, ir.Local) and expr.name in self.scope.bare and isinstance(want, Scalar) and want.is_number
        ):
            return ""
        return f"where `{expr.name}` begins, write `{expr.name}: {want} = …`; a bare literal makes it {expr.type}"

    def is_known(self, name: str) -> bool:
        """Whether a name is something in this function, if only something wrong."""
        s = self.scope
        return any(
            name in names
            for names in (s.types, s.arguments, s.records, s.constants, s.poisoned, s.wrong, s.ranges, s.dead_ranges)
        ) or name in ("TransitionRequest", "Health")

    def origin(self, expr: ir.Expr) -> tuple[tuple[Span, str], ...]:
        """A note on where a named value got its type."""
        root = expr
        while isinstance(root, ir.Element | ir.Slice | ir.Member):
            root = root.base
        if isinstance(root, ir.Local) and root.name in self.scope.types and root.name.isidentifier():
            return ((self.scope.types[root.name][1], f"`{root.name}` became {root.type} here"),)
        if isinstance(root, ir.Field):
            port = self.scope.ports[root.record][root.name]
            automatic = port.span.column == port.span.end_column  # health and transition_request stand in no file
            return () if automatic else ((port.span, f"`{root.name}` is declared {root.type} here"),)
        return ()

    def raw(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """As check, but a literal stays one."""
        raise NotImplementedError

    # ---- operations of the op table ----------------------------------------------------------------------------------

    def meet(self, left: ir.Expr, right: ir.Expr) -> tuple[ir.Expr, ir.Expr]:
        """A literal or loop variable adopts the other operand's scalar type."""
        left_type, right_type = element_of(left.type), element_of(right.type)
        if is_literal(left_type) and is_literal(right_type):
            both = F64 if FLOAT_LITERAL in (left_type, right_type) else I64
            return self.settle(left, both), self.settle(right, both)
        if is_literal(left_type) or (isinstance(left, ir.RangeVar) and not is_literal(right_type)):
            return self.settle(left, right_type), right
        return left, self.settle(right, left_type)

    def find(self, name: str, scalars: tuple[Type, ...], args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ops.Op:
        op = ops.find(name, tuple(s for s in scalars if isinstance(s, Scalar)))
        if op is None:
            self._no_such_operation(symbol, args, span)
        return op

    def apply(self, name: str, args: tuple[ir.Expr, ...], span: Span, symbol: str = "") -> ir.Expr:
        """One operation of the op table on settled scalars."""
        op = self.find(name, tuple(a.type for a in args), args, symbol or name, span)
        fault = bool(op.faults)
        if fault and op.proven:
            fault = not self._cannot_fault(op, args, span)
        self.scope.faults = self.scope.faults or fault
        return ir.Apply(op.result, op, args, fault, span)

    def _cannot_fault(self, op: ops.Op, args: tuple[ir.Expr, ...], span: Span) -> bool:
        """What bounds of the operands prove; reports an operation that faults whenever it runs."""
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
        types = [a.type for a in args]
        scalars = [t for t in types if isinstance(t, Scalar)]
        fix, why = "", ""
        if symbol == "/" and all(t.is_integer for t in scalars) and len(scalars) == 2:
            fix = "write `//` for the floor, or f64(a) / f64(b)"
            why = "`/` is for floats only"
        elif symbol in ("<<", ">>", "&", "|", "^", "~"):
            fix = _bits_hint(symbol, types)
            why = "bits belong to integers of one type" if symbol in "&|^~" else ""
        elif BOOL in scalars:
            fix = "write `1.0 if condition else 0.0`" if len(set(scalars)) > 1 or symbol in "+-*/" else ""
            fix = fix or ("write `not x`" if len(types) == 1 else "")
            why = "a bool has no arithmetic and no order"
        elif len(set(types)) > 1:
            if len(scalars) == len(types):
                fix = f"convert one side: {types[0]}(…) or {types[1]}(…)"
            why = "types never mix implicitly"
        for arg, other in zip(args, reversed(args), strict=True):
            fix = self._begin(arg, other.type) or fix
        listed = " and ".join(map(str, types))
        notes = (
            [n for a in args for n in ((a.span, f"this is {a.type}"), *self.origin(a))] if len(set(types)) > 1 else []
        )
        verb = "between" if len(args) > 1 else "of"
        self.fail("E415", f"no `{symbol}` {verb} {listed}", span, why=why, help=fix, notes=tuple(notes))


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
