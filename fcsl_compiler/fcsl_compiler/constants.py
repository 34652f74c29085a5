# SPDX-License-Identifier: Apache-2.0
"""Module constants, folded exactly at compile time."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from . import ir
from .check_expr import ExprChecker
from .checker import Stop
from .diagnostics import DiagnosticSink
from .literals import INT_LITERAL, is_literal
from .pysource import span_of
from .scope import ArrayConstant, ScalarConstant, Scope, Signature
from .source import Span
from .types import Array, Type

if TYPE_CHECKING:
    from .declarations import Declarations


class _NoFunctions:
    """Constants call nothing."""

    externs: dict[str, ir.Extern] = {}

    def is_function(self, name: str) -> bool:
        return False

    def guides(self, name: str, count: int) -> list[Type | None]:
        raise AssertionError(name)

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        raise AssertionError(name)


def check_constant(
    declarations: Declarations, name: str, annotation: ast.expr | None, value: ast.expr, sink: DiagnosticSink
) -> None:
    """Folds `name = value` into the declarations; reports what is not constant."""
    from .declarations import annotation_type

    scope = Scope(
        declarations.source,
        declarations.constants,
        {},
        {},
        _NoFunctions(),
        {},
        declarations.names,
        wrong=declarations.wrong,
    )
    checker = ExprChecker(scope, sink)
    declared: Type | None = None
    if annotation is not None:
        parsed = annotation_type(declarations.source, annotation, declarations.names, False, sink)
        if parsed is None:
            return
        declared = parsed[0]
    try:
        expr = checker.raw(value, declared)
        if declared is not None:
            expr = checker.settle(expr, declared)
            if expr.type != declared:
                checker.mismatch(expr, declared, f"`{name}`")
    except Stop:
        return
    if isinstance(expr, ir.Const):
        declarations.constants[name] = ScalarConstant(expr)
        declarations.wrong.discard(name)
        if isinstance(expr.value, int) and not isinstance(expr.value, bool) and expr.type is INT_LITERAL:
            declarations.names.sizes[name] = expr.value
        return
    if isinstance(expr, ir.ArrayValue) and all(isinstance(i, ir.Const) and not is_literal(i.type) for i in expr.items):
        values = tuple(i.value for i in expr.items if isinstance(i, ir.Const) and not isinstance(i.value, str))
        assert isinstance(expr.type, Array)
        declarations.constants[name] = ArrayConstant(declarations.owner, expr.type, values)
        declarations.wrong.discard(name)
        return
    sink.error(
        "E308",
        f"`{name}` is not a constant",
        span_of(declarations.source, value),
        why="module constants are folded at compile time",
        help="literals, earlier constants and + - * / // % of them are; compute the rest in `start`",
    )
