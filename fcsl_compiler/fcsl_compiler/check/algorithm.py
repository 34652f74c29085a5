# SPDX-License-Identifier: Apache-2.0
"""Checks one algorithm: class to typed IR."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from types import MappingProxyType

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.effects import warn_fault_after_effect
from ..model.types import TypeNames
from ..parse.python_source import assigned_fields, span_of
from .algorithm_class import AlgorithmClass, name_span
from .declarations import Declarations
from .fault_points import warn_copies
from .functions import FunctionTable
from .scope import Scope
from .statements import BodyChecker

NO_SIZES: Mapping[str, int] = MappingProxyType({})


def check_algorithm(
    name: str,
    found: AlgorithmClass,
    files: tuple[str, ...],
    table: FunctionTable,
    sound: bool,
    sink: DiagnosticSink,
    sizes: Mapping[str, int] = NO_SIZES,
) -> ir.Algorithm:
    """Checks the methods of a class. If the class has an error, or its file is not `sound`, the result has the ports
    and an empty `execute`. Its instances and connections are then still checked in the same run.

    `files`: names of the algorithm's file and of the files it imports from. `sizes`: those that the machine JSON binds.
    """
    declarations, before = table.declarations, sink.errors
    owner = f"alg_{name}"
    if "execute" not in found.methods and "execute" not in (found.wrong | declarations.wrong):
        why, fix = "it is the method that runs in a tick", "def execute(self):"
        sink.error("E309", f"`{found.name}` has no `execute`", found.span, why=why, help=fix)
    requests: dict[str, Span] = {}
    execute = _method(declarations, found, "execute", owner, table, requests, sink, sizes)
    start = _method(declarations, found, "start", owner, table, requests, sink, sizes)
    complete = sound and execute is not None and sink.errors == before
    if not complete or execute is None:
        execute = ir.Function(f"{owner}__execute", "execute", (), (), None, (), (), False, (), found.span)
        start = None
    for function in (execute, start):
        table.program.use(function.calls if function is not None else ())
    for helper in _reached(execute, start, table):
        requests.update({n: s for n, s in helper.requests if n not in requests})
    ports = {record: tuple(ports) for record, ports in found.ports.items()}
    if complete:
        warn_copies(execute, ports, sink)
    return ir.Algorithm(
        name,
        declarations.source.name,
        files,
        found.doc,
        ports,
        execute,
        start,
        tuple(requests.items()),
        tuple(declarations.externs.values()),
        found.requests is not None,
        complete,
        {method: assigned_fields(node) for method, node in found.methods.items()},
    )


def _reached(execute: ir.Function, start: ir.Function | None, table: FunctionTable) -> list[ir.Function]:
    """All helpers that the methods call, directly or indirectly."""
    found: dict[str, ir.Function] = {}

    def reach(function: ir.Function) -> None:
        for name in function.calls:
            helper = table.program.helpers.get(name)
            if helper is not None and name not in found:
                found[name] = helper
                reach(helper)

    reach(execute)
    if start is not None:
        reach(start)
    return list(found.values())


def _method(
    declarations: Declarations,
    found: AlgorithmClass,
    name: str,
    owner: str,
    table: FunctionTable,
    requests: dict[str, Span],
    sink: DiagnosticSink,
    sizes: Mapping[str, int],
) -> ir.Function | None:
    """Checks one method. Returns None if the class lacks it or after reporting an error. Adds the requests that the
    method names to `requests`."""
    node = found.methods.get(name)
    if node is None or not _check_signature(declarations, node, sink):
        return None
    scope = Scope(
        declarations.source,
        declarations.constants,
        table,
        {},
        TypeNames({**declarations.names.sizes, **sizes}, declarations.names.structs),
        variables=sizes,
        wrong=declarations.wrong,
        uses_library=declarations.uses_library,
        algorithm=found,
        method=name,
    )
    before = sink.errors
    body = BodyChecker(scope, sink).function(node.body)
    warn_fault_after_effect(body, sink)
    for request, span in scope.requests.items():
        requests.setdefault(request, span)
    if sink.errors != before:
        return None
    return ir.Function(
        f"{owner}__{name}",
        name,
        (),
        ir.records(body),
        None,
        tuple((n, t) for n, (t, _) in scope.types.items()),
        body,
        scope.faults,
        tuple(scope.calls),
        name_span(declarations.source, node),
        tuple(scope.requests.items()),
        tuple(scope.loop_parameters.items()),
    )


def _check_signature(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> bool:
    """Accepts `def execute(self)`, with or without `-> None`. Returns False after reporting anything else."""
    source, a, right = declarations.source, node.args, f"def {node.name}(self):"
    if node.decorator_list:
        at = span_of(source, node.decorator_list[0])
        sink.error("E310", "a decorator on a method", at, help="remove it")
        return False
    plain = not (a.defaults or a.kwonlyargs or a.vararg or a.kwarg or a.posonlyargs)
    if not plain or [b.arg for b in a.args] != ["self"]:
        why = "inputs, parameters, outputs and state are fields of `self`"
        at = name_span(source, node)
        sink.error("E310", f"`{node.name}` takes `self` and nothing else", at, why=why, help=right)
        return False
    if a.args[0].annotation is not None:
        sink.error("E310", "`self` has no annotation", span_of(source, a.args[0].annotation), help=right)
        return False
    if node.returns is not None and not (isinstance(node.returns, ast.Constant) and node.returns.value is None):
        sink.error("E425", f"{node.name} returns nothing", span_of(source, node.returns), help=right)
        return False
    return True
