# SPDX-License-Identifier: Apache-2.0
"""One algorithm file: from its syntax tree to checked IR."""

from __future__ import annotations

import ast

from . import ir
from .check_body import BodyChecker
from .declarations import RECORDS, Declarations, collect, record_of
from .diagnostics import DiagnosticSink, misspelt
from .effects import warn_fault_after_effect
from .functions import FunctionTable, Program, check_imported_names, check_plain
from .pysource import span_of
from .scope import LANGUAGE_NAMES, Scope, StoredConstant
from .source import SourceFile, Span
from .types import HEALTH, REQUEST


def check_algorithm(
    name: str, source: SourceFile, tree: ast.Module, program: Program, sink: DiagnosticSink
) -> ir.Algorithm | None:
    """Checks the whole file. None when its ports or constants were reported as wrong; with another error in it the
    algorithm has its ports and an empty `execute`, so that its instances and connections are checked in the same run.
    """
    before, prefix = sink.errors, f"alg_{name}"
    declarations = collect(source, tree, prefix, program.structs, sink)
    declared = sink.errors == before
    check_imported_names(declarations, tree, sink)
    if "execute" not in declarations.functions:
        _report_no_execute(declarations, sink)
    table = FunctionTable(prefix, declarations, program, sink)
    table.check_helpers()
    execute = _entry(declarations, "execute", prefix, table, sink)
    start = _entry(declarations, "start", prefix, table, sink)
    if not declared:
        return None
    nothing = ir.Function(f"{prefix}__execute", "execute", (), (), None, (), (), False, (), source.whole())
    if execute is None or sink.errors != before:
        execute, start = nothing, None
    constants = tuple((n, c.type, c.values) for n, c in declarations.constants.items() if isinstance(c, StoredConstant))
    own = tuple(f for f in program.functions.values() if f.name.startswith(prefix + "__"))
    ports = {record: tuple(found) for record, found in declarations.ports.items()}
    return ir.Algorithm(
        name,
        source.name,
        declarations.doc,
        ports,
        own,
        constants,
        execute,
        start,
        tuple(table.requests.items()),
        tuple(declarations.externs.values()),
        execute is not nothing,
    )


def _report_no_execute(declarations: Declarations, sink: DiagnosticSink) -> None:
    """Points at the function that was meant, where there is one, and leaves it unchecked."""
    at, fix = declarations.source.whole(), "def execute(u: Inputs, y: Outputs) -> None:"
    meant = misspelt("execute", list(declarations.functions))
    if meant:
        at = _name_span(declarations.source, declarations.functions.pop(meant))
        fix = f"rename `{meant}`, if it was meant to be it"
    sink.error("E309", "this file has no `execute`", at, why="it is what runs in a tick", help=fix)


def _entry(
    declarations: Declarations, name: str, prefix: str, table: FunctionTable, sink: DiagnosticSink
) -> ir.Function | None:
    """execute or start: its arguments are records, recognised by annotation."""
    node = declarations.functions.get(name)
    if node is None or not check_plain(declarations.source, node, sink):
        return None
    source = declarations.source
    records: dict[str, str] = {}
    for argument in node.args.args:
        at = span_of(source, argument)
        record = record_of(argument.annotation, declarations)
        if argument.arg in LANGUAGE_NAMES:
            sink.error("E422", f"`{argument.arg}` is a name of the language", at, help="use another name")
        elif (
            record is None
            and isinstance(argument.annotation, ast.Name)
            and argument.annotation.id in declarations.wrong
        ):
            declarations.wrong.add(argument.arg)  # the class has been reported
        elif record is None:
            declarations.wrong.add(argument.arg)
            fix = f"annotate it with one of {', '.join(RECORDS)}"
            sink.error("E310", f"`{argument.arg}` of {name} is not a record", at, help=fix)
        elif name == "start" and record == "inputs":
            why = "nothing has run yet when start does"
            sink.error("E310", "start has no inputs", at, why=why, help="use parameters")
        elif record in records.values():
            sink.error("E310", f"{name} receives {record} twice", at, help="one argument holds all of them; remove one")
        else:
            records[argument.arg] = record
    if node.returns is not None and not (isinstance(node.returns, ast.Constant) and node.returns.value is None):
        sink.error("E425", f"{name} returns nothing", span_of(source, node.returns), help=f"def {name}(…) -> None:")
    ports = {record: {p.name: p for p in found} for record, found in declarations.ports.items()}
    scope = Scope(
        source, declarations.constants, records, ports, table, {}, declarations.names, wrong=declarations.wrong
    )
    scope.effects = name == "execute"
    before = sink.errors
    body = BodyChecker(scope, sink).body(node.body, docstring=True)
    if name == "start":
        for target, _, _ in ir.writes(body):
            if isinstance(target, ir.Field) and target.type in (REQUEST, HEALTH):
                why = "it is the word of one tick, and start is in none"
                sink.error("E433", f"start cannot set {target.name}", target.span, why=why, help="set it in execute")
    warn_fault_after_effect(body, sink)
    for request, span in scope.requests.items():
        table.requests.setdefault(request, span)
    if sink.errors != before:
        return None
    return ir.Function(
        table.unique(name),
        name,
        (),
        tuple(records.items()),
        None,
        tuple((n, t) for n, (t, _) in scope.types.items()),
        body,
        scope.faults,
        tuple(scope.calls),
        _name_span(source, node),
    )


def _name_span(source: SourceFile, node: ast.FunctionDef) -> Span:
    line = span_of(source, node)
    return Span(source, line.line, line.column, line.line, line.column + len("def ") + len(node.name))
