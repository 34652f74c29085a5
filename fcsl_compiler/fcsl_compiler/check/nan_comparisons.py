# SPDX-License-Identifier: Apache-2.0
"""W306: comparisons with NaN. Their result does not depend on the other operand."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from .folding import DoesNotFit, fold

_COMPARISONS = ("==", "!=", "<", "<=", ">", ">=")


def warn_nan_comparisons(functions: Iterable[ir.Function], sink: DiagnosticSink) -> None:
    for function in functions:
        for statement in ir.walk(function.body):
            for expression in ir.expressions(statement):
                _check(expression, sink)


def _check(e: ir.Expr, sink: DiagnosticSink) -> None:
    if isinstance(e, ir.Apply) and e.op.name in _COMPARISONS and any(map(_is_nan, e.args)):
        other = e.args[0] if _is_nan(e.args[1]) else e.args[1]
        always, test = ("True", "not isnan") if e.op.name == "!=" else ("False", "isnan")
        message = f"`{e.op.name}` with NaN is always {always}"
        why = "NaN equals nothing, itself included, and is neither less nor greater"
        sink.warning("W306", message, e.span, why=why, help=f"write `{test}({_text(other.span)})`")
    for child in ir.children(e):
        _check(child, sink)


def _is_nan(e: ir.Expr) -> bool:
    try:
        known = fold(e)
    except DoesNotFit:
        return False
    return isinstance(known, ir.Const) and isinstance(known.value, float) and math.isnan(known.value)


def _text(span: Span) -> str:
    """Source text of an expression, or "…" if it is long."""
    text = span.source.line(span.line)[span.column - 1 : span.end_column - 1]
    return text if span.line == span.end_line and len(text) <= 40 else "…"
