# SPDX-License-Identifier: Apache-2.0
"""Module constants. Values are folded exactly at compile time."""

from __future__ import annotations

import ast

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.literals import LiteralError
from ..model.types import Array, Struct, Type
from ..parse.python_source import span_of
from .annotations import annotation_text, annotation_type
from .checker import Stop
from .declarations import Declarations
from .expressions import ExprChecker
from .folding import DoesNotFit, fold
from .inference import Inference
from .literal_values import default_type, untyped_constant
from .scope import Arguments, ScalarConstant, Scope, Signature, StoredConstant


class _NoFunctions:
    """The function table of constants: empty, because a constant calls no function."""

    externs: dict[str, ir.Extern] = {}

    def is_function(self, name: str) -> bool:
        return False

    def names(self) -> list[str]:
        return []

    def declared(self, name: str, count: int) -> tuple[list[Type | str | None], Type | str | None]:
        raise AssertionError(name)

    def arguments(self, name: str) -> Arguments | None:
        raise AssertionError(name)

    def resolve(self, name: str, arguments: list[ir.Expr], span: Span) -> Signature | None:
        raise AssertionError(name)


def check_constant(
    declarations: Declarations, name: str, annotation: ast.expr | None, value: ast.expr, sink: DiagnosticSink
) -> None:
    """Folds `name = value` into the declarations. Reports a value that is not constant."""
    scope = Scope(
        declarations.source,
        declarations.constants,
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
    inference = checker.inference
    inference.expression(value, declared)
    if declared is None and inference.literal_type(value) is not None:
        _untyped(declarations, name, value, inference, sink)
        return
    try:
        shown = f"`{name.rpartition('.')[2]}`"  # an argument's name follows that of its helper
        expr = checker.raw(value) if declared is None else checker.expect(value, declared, shown)
        expr = fold(expr)
    except Stop:
        return
    except DoesNotFit as error:
        sink.error("E401", f"`{name}`: {error}", span_of(declarations.source, value), help="use a wider type")
        return
    if isinstance(expr, ir.Const):
        declarations.constants[name] = ScalarConstant(expr)
        _count(declarations, name, expr.value)
        declarations.wrong.discard(name)
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


def check_defaults(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> None:
    """Folds the defaults of a helper's arguments into the declarations."""
    behind = node.args.args[len(node.args.args) - len(node.args.defaults) :]
    for argument, value in zip(behind, node.args.defaults, strict=True):
        key = f"{node.name}.{argument.arg}"
        if argument.annotation is None:
            continue  # said where the function is checked
        type_ = annotation_text(argument.annotation) or ""
        if "[" in type_ or type_ in declarations.names.structs:
            at, why = span_of(declarations.source, value), "a default is one number, bool, health or request"
            fix = f"leave it out, and give `{argument.arg}` at each call"
            sink.error("E431", f"`{argument.arg}` is {type_} and has a default", at, why=why, help=fix)
            declarations.wrong.add(node.name)
            continue
        check_constant(declarations, key, argument.annotation, value, sink)
        found = declarations.constants.pop(key, None)
        if isinstance(found, ScalarConstant):
            declarations.defaults[node.name, argument.arg] = found.value
        else:
            declarations.wrong.add(node.name)


def _untyped(
    declarations: Declarations, name: str, value: ast.expr, inference: Inference, sink: DiagnosticSink
) -> None:
    """Registers a constant without a type: each use replaces it by its literals. At least one type must be able to hold
    its value."""
    constant = untyped_constant(inference.names, value, inference.holds_float(value))
    first = constant.values[default_type(constant.holds_float)]
    if isinstance(first, LiteralError) and all(isinstance(v, LiteralError) for v in constant.values.values()):
        sink.error("E401", str(first.args[0]), span_of(declarations.source, value), help=str(first.args[1]))
        return
    declarations.constants[name] = constant
    declarations.wrong.discard(name)
    if isinstance(first, int):
        declarations.names.sizes[name] = first
    _count(declarations, name, first)


def _count(declarations: Declarations, name: str, value: object) -> None:
    """Numbers may be bounds of ranges."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        declarations.names.numbers[name] = value


def _flat(expr: ir.Expr) -> tuple[bool | int | float | str, ...] | None:
    """The scalar values of an array or struct in row-major order. None if a part is not constant."""
    if isinstance(expr, ir.Const):
        return (expr.value,)
    if not isinstance(expr, ir.ArrayValue | ir.StructValue):
        return None
    parts = [_flat(item) for item in expr.items]
    return None if None in parts else tuple(v for p in parts if p is not None for v in p)
