# SPDX-License-Identifier: Apache-2.0
"""Loop bounds that depend on parameters. They become known, and are checked, when an instance freezes these
parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from .intervals import interval, is_static

#: Maximum total number of iterations of nested loops.
MAX_ITERATIONS = 10_000_000
MAX_BOUND = 2**31

TOO_MANY = f"at most {MAX_ITERATIONS} are allowed, enclosing loops included"
BEYOND = "a loop bound beyond 2^31"


def parameters_in(bound: ir.Expr) -> list[ir.Field] | None:
    """The parameters that a bound depends on, if it otherwise contains only constants and loop variables. None for any
    other bound."""
    if isinstance(bound, ir.Field) and bound.record == "parameters":
        return [bound]
    if not isinstance(bound, ir.Apply):
        return [] if is_static(bound) else None
    parts = [parameters_in(a) for a in bound.args]
    return None if None in parts else [p for part in parts if part is not None for p in part]


def check_loops(
    instance: str,
    functions: Iterable[ir.Function | None],
    frozen: Collection[str],
    values: Collection[str],
    at: Span,
    sink: DiagnosticSink,
) -> bool:
    """Checks that an instance has frozen every parameter that bounds a loop, that each has a value, and that no loop is
    too long. Returns False after reporting E424, or if a value is missing, which was reported earlier."""
    before, complete = sink.errors, True
    for function in functions:
        needed = dict(function.loop_parameters) if function is not None else {}
        for name, span in needed.items():
            if name not in frozen:
                why, notes = "a tick has a worst-case time only if every loop has a bound", [(span, "the bound")]
                message = f"`{name}` of `{instance}` bounds a loop and is not frozen"
                fix = f'add `"frozen": ["{name}"]`'
                sink.error("E424", message, at, why=why, notes=notes, help=fix)
        complete &= all(name in values for name in needed)
        if function is not None and complete and sink.errors == before:
            _check_body(function.body, 1, instance, at, sink)
    return complete and sink.errors == before


def _check_body(body: tuple[ir.Stmt, ...], outside: int, instance: str, at: Span, sink: DiagnosticSink) -> None:
    """`outside`: product of the iteration counts of the enclosing loops."""
    for s in body:
        if isinstance(s, ir.If):
            _check_body((*s.then, *s.otherwise), outside, instance, at, sink)
        elif isinstance(s, ir.For):
            start, stop = interval(s.start), interval(s.stop)
            assert start and stop
            notes, fix = [(s.span, "this loop")], "freeze a smaller value"
            turns = range(start[0], stop[1], s.step) if s.step > 0 else range(start[1], stop[0], s.step)
            total = outside * max(1, len(turns))
            if max(map(abs, (*start, *stop))) > MAX_BOUND:
                sink.error("E424", f"`{instance}`: {BEYOND}", at, notes=notes, help=fix)
            elif total > MAX_ITERATIONS:
                message = f"`{instance}`: a loop of {total} iterations"
                sink.error("E424", message, at, why=TOO_MANY, notes=notes, help=fix)
            else:
                _check_body(s.body, total, instance, at, sink)
