# SPDX-License-Identifier: Apache-2.0
"""Module constants, folded exactly at compile time."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING

from . import ir
from .check_expr import ExprChecker
from .checker import Stop
from .diagnostics import DiagnosticSink
from .folding import DoesNotFit, fold
from .literals import INT_LITERAL, is_literal
from .pysource import span_of
from .scope import ScalarConstant, Scope, Signature, StoredConstant
from .source import Span
from .types import Array, Struct, Type

if TYPE_CHECKING:
    from .declarations import Declarations


class _NoFunctions:
    """Constants call nothing."""

    externs: dict[str, ir.Extern] = {}

    def is_function(self, name: str) -> bool:
        return False

    def names(self) -> list[str]:
        return []

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
        expr = fold(expr)
    except Stop:
        return
    except DoesNotFit as error:
        sink.error("E401", f"`{name}`: {error}", span_of(declarations.source, value), help="use a wider type")
        return
    if isinstance(expr, ir.Const):
        declarations.constants[name] = ScalarConstant(expr)
        declarations.wrong.discard(name)
        if isinstance(expr.value, int) and not isinstance(expr.value, bool) and expr.type is INT_LITERAL:
            declarations.names.sizes[name] = expr.value
        return
    values = _flat(expr)
    if values is not None:
        assert isinstance(expr.type, Array | Struct)
        declarations.constants[name] = StoredConstant(declarations.owner, expr.type, values)
        declarations.wrong.discard(name)
        return
    sink.error(
        "E308",
        f"`{name}` is not a constant",
        span_of(declarations.source, value),
        why="module constants are folded at compile time",
        help="literals, earlier constants and operators on them are; compute the rest in `start`",
    )


def _flat(expr: ir.Expr) -> tuple[bool | int | float, ...] | None:
    """The constants an array or struct is made of; None when something in it is computed."""
    if isinstance(expr, ir.Const) and not is_literal(expr.type) and not isinstance(expr.value, str):
        return (expr.value,)
    if not isinstance(expr, ir.ArrayValue | ir.StructValue):
        return None
    parts = [_flat(item) for item in expr.items]
    return None if None in parts else tuple(v for p in parts if p is not None for v in p)
