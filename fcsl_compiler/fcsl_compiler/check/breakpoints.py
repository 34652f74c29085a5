# SPDX-License-Identifier: Apache-2.0
"""E441: tables whose breakpoints are known and do not ascend."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ..base.diagnostics import DiagnosticSink
from ..model import ir
from ..model.machine import Instance, Values
from ..model.program import Program

#: Arguments that are breakpoints, by function of library/tables.py.
BREAKPOINTS = {
    "interp_cell": (1,),
    "interp": (1,),
    "extrapolate": (1,),
    "interp2": (2, 3),
    "extrapolate2": (2, 3),
    "interp3": (3, 4, 5),
    "extrapolate3": (3, 4, 5),
}
_LIBRARY = "<library>/tables.py"


def check_breakpoints(instances: Iterable[Instance], program: Program, sink: DiagnosticSink) -> None:
    """Reports breakpoints that are literals, constants of a file, or parameters with a value that does not ascend."""
    for helper in program.helpers.values():
        if helper.span.source.name != _LIBRARY:
            _check(helper, None, program, sink)
    for instance in instances:
        for entry in (instance.execute, instance.start):
            if entry is not None:
                _check(entry, instance, program, sink)


def _check(function: ir.Function, instance: Instance | None, program: Program, sink: DiagnosticSink) -> None:
    for call in _calls(function):
        callee = program.functions.get(call.function) or program.helpers.get(call.function)
        if callee is None or callee.span.source.name != _LIBRARY:
            continue
        for position in BREAKPOINTS.get(callee.source_name, ()):
            argument = call.args[position]
            values = _values(argument, instance, program)
            at = next((n for n, (a, b) in enumerate(zip(values, values[1:], strict=False)) if not a < b), None)  # type: ignore[operator]
            if at is not None:
                message = (
                    f"breakpoints of `{callee.source_name}` do not ascend: {values[at]} is followed by {values[at + 1]}"
                )
                given = (
                    [(instance.span, f"`{instance.name}` has them")]
                    if _is_parameter(argument, program) and instance
                    else []
                )
                why = "the cell of a point is found by bisection"
                sink.error("E441", message, argument.span, why=why, help="sort the points", notes=given)


def _calls(function: ir.Function) -> Iterator[ir.Call]:
    for statement in ir.walk(function.body):
        stack = list(ir.expressions(statement))
        while stack:
            e = stack.pop()
            stack += ir.children(e)
            if isinstance(e, ir.Call):
                yield e


def _values(e: ir.Expr, instance: Instance | None, program: Program) -> Values:
    """The elements of an argument; () if they are not known."""
    if isinstance(e, ir.ArrayValue):
        known = tuple(item.value for item in e.items if isinstance(item, ir.Const))
        return known if len(known) == len(e.items) else ()
    if isinstance(e, ir.ModuleConst) and (e.owner, e.name) in program.constants:
        return program.constants[e.owner, e.name][1]
    if instance is not None and isinstance(e, ir.Field | ir.ModuleConst) and _is_parameter(e, program):
        return instance.parameters.get(e.name, ())
    return ()


def _is_parameter(e: ir.Expr, program: Program) -> bool:
    """Whether it is a parameter, or a frozen one."""
    if isinstance(e, ir.Field):
        return e.record == "parameters"
    return isinstance(e, ir.ModuleConst) and (e.owner, e.name) not in program.constants
