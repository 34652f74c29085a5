# SPDX-License-Identifier: Apache-2.0
"""The module level of an algorithm file: port classes, constants, functions; collected before any body is checked."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field

from . import ir, ops
from .c_names import C_KEYWORDS
from .diagnostics import DiagnosticSink, misspelt, nearest
from .effects import HARDWARE
from .pysource import span_of, trailing_comment
from .python_habits import instead_of_import
from .ranges import UNBOUNDED, Range, parse_range, split_range
from .scope import BUILTIN_CONSTANTS, CONSTRUCTORS, LANGUAGE_NAMES, Constant
from .source import SourceFile, Span
from .types import HEALTH, REQUEST, SCALARS, Struct, Type, TypeNames, TypeSyntaxError, element_of, parse_type

#: Port classes and the records (and path segments) they declare.
RECORDS = {"Inputs": "inputs", "Parameters": "parameters", "Outputs": "outputs", "State": "state"}

#: What fcsl_builtins offers beside the library.
IMPORTABLE = (
    "extern",
    *HARDWARE,
    *ops.BUILTINS,
    *CONSTRUCTORS,
    *BUILTIN_CONSTANTS,
    *(n for n in SCALARS if n not in ops.BUILTINS),
)

_MAX_TYPE = 200  # characters of a type with its unit
_SNAKE = re.compile(r"[a-z](_?[a-z0-9])*")
_RESERVED_OUTPUTS = ("transition_request", "health", "header", "tick")


@dataclass
class Declarations:
    """What one file declares, with the syntax trees of bodies still unchecked."""

    source: SourceFile
    doc: str
    owner: str  # of its constants, in C
    names: TypeNames
    ports: dict[str, list[ir.Port]] = field(default_factory=lambda: {r: [] for r in RECORDS.values()})
    constants: dict[str, Constant] = field(default_factory=dict)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    externs: dict[str, ir.Extern] = field(default_factory=dict)
    #: Where each constant and function is defined.
    defined: dict[str, Span] = field(default_factory=dict)
    #: Port classes under a name that was reported, and what they were meant to be.
    misspelt: dict[str, str] = field(default_factory=dict)
    #: Names of ports, constants and classes whose declaration was reported; their uses stay silent.
    wrong: set[str] = field(default_factory=set)


def record_of(annotation: ast.expr | None, declarations: Declarations) -> str | None:
    """The record that an annotation names."""
    if isinstance(annotation, ast.Name):
        name = annotation.id
    elif isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        name = annotation.value
    else:
        return None
    return RECORDS.get(declarations.misspelt.get(name, name))


def annotation_type(
    source: SourceFile, node: ast.expr, names: TypeNames, allow_unit: bool, sink: DiagnosticSink
) -> tuple[Type, str] | None:
    """Type (and unit) of an annotation: a string, a name, or `f64[3]`. None after reporting E301."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) <= _MAX_TYPE:
        text = node.value
    elif isinstance(node, ast.Name | ast.Subscript):
        text = ast.unparse(node).replace("(", "").replace(")", "")
    else:
        sink.error("E301", "this is not a type", span_of(source, node), help='write `f64`, or a string: "f64[3] rad/s"')
        return None
    try:
        return parse_type(text, names, allow_unit)
    except TypeSyntaxError as error:
        sink.error("E301", str(error.args[0]), span_of(source, node), help=str(error.args[1]))
        return None


def _port_type(
    source: SourceFile, node: ast.expr, record: str, names: TypeNames, sink: DiagnosticSink
) -> tuple[Type, str, Range] | None:
    """Type, unit and range of a port. None after reporting E301 or E312."""
    text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
    plain, bounds, at = split_range(text) if len(text) <= _MAX_TYPE else (text, None, 0)
    if bounds is None:
        parsed = annotation_type(source, node, names, True, sink)
        return (*parsed, UNBOUNDED) if parsed is not None else None
    parsed = annotation_type(source, ast.copy_location(ast.Constant(plain), node), names, True, sink)
    if parsed is None:
        return None
    span = _part_of_string(source, node, text, at, at + len(bounds))
    if record != "Parameters":
        why = "a range bounds what a host may set, and a host tunes parameters"
        sink.error("E312", f"a range (`{bounds}`) on a port of {record}", span, why=why, help="remove it")
        return None
    try:
        return (*parsed, parse_range(bounds, parsed[0]))
    except TypeSyntaxError as error:
        sink.error("E312", str(error.args[0]), span, help=str(error.args[1]))
        return None


def _part_of_string(source: SourceFile, node: ast.expr, text: str, begin: int, end: int) -> Span:
    """The span of text[begin:end] in a string literal; the whole literal where it is not written as it reads."""
    span = span_of(source, node)
    written = source.line(span.line)[span.column - 1 : span.end_column - 1]
    if span.line != span.end_line or written[1:-1] != text:
        return span
    return Span(source, span.line, span.column + 1 + begin, span.line, span.column + 1 + end)


def collect(
    source: SourceFile, tree: ast.Module, owner: str, structs: dict[str, Struct], sink: DiagnosticSink
) -> Declarations:
    """Port classes, constants (folded) and functions of a file, in any order but constants before their use."""
    declarations = Declarations(source, (ast.get_docstring(tree) or "").strip(), owner, TypeNames({}, structs))
    classes: dict[str, Span] = {}
    beginning = True  # nothing but the docstring and __future__ so far
    for position, node in enumerate(tree.body):
        span = span_of(source, node)
        if isinstance(node, ast.Expr) and position == 0 and isinstance(node.value, ast.Constant):
            continue
        if isinstance(node, ast.ImportFrom) and node.module == "__future__" and not beginning:
            fix = "move it to the beginning of the file"
            sink.error("E304", "`__future__` is imported before everything else", span, help=fix)
            continue
        beginning = beginning and isinstance(node, ast.ImportFrom) and node.module == "__future__"
        if isinstance(node, ast.ImportFrom | ast.Import):
            _check_import(source, node, sink)
        elif isinstance(node, ast.ClassDef):
            if node.name in classes:
                notes = [(classes[node.name], "first here")]
                fix = "one class holds all ports of a kind"
                sink.error("E302", f"`{node.name}` is declared twice", span, help=fix, notes=notes)
                continue
            classes[node.name] = span
            _class(declarations, node, sink)
        elif isinstance(node, ast.FunctionDef):
            if _free(declarations, node.name, span, sink):
                _function(declarations, node, sink)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            _constant(declarations, node, sink)
        else:
            sink.error(
                "E303",
                "this does not belong at module level",
                span,
                help="a file holds port classes, constants and functions",
            )
    for name, type_ in (("transition_request", REQUEST), ("health", HEALTH)):
        declarations.ports["outputs"].append(ir.Port(name, type_, "", "", source.whole()))
    return declarations


def _check_import(source: SourceFile, node: ast.ImportFrom | ast.Import, sink: DiagnosticSink) -> None:
    why = "an algorithm is compiled from this file alone"
    if isinstance(node, ast.Import):
        for alias in node.names:
            if alias.name == "fcsl_builtins":
                fix = "write `from fcsl_builtins import …`"
            else:
                fix = instead_of_import(alias.name, (), ())
            sink.error("E304", f"`{alias.name}` cannot be imported", span_of(source, alias), why=why, help=fix)
        return
    if node.module == "__future__" and [a.name for a in node.names] != ["annotations"]:
        fix = "`annotations` is all that means something here"
        sink.error("E304", "this cannot be imported from `__future__`", span_of(source, node), help=fix)
        return
    if node.module in ("fcsl_builtins", "__future__") and node.level == 0:
        for alias in node.names:
            if alias.asname not in (None, alias.name):
                renamed = f"`{alias.asname}` would mean something else here than in CPython"
                sink.error(
                    "E304",
                    "an import under another name",
                    span_of(source, alias),
                    why=renamed,
                    help="import it as it is",
                )
        return
    sink.error(
        "E304",
        f"`{'.' * node.level}{node.module or ''}` cannot be imported",
        span_of(source, node),
        why=why,
        help=instead_of_import(node.module or "", [a.name for a in node.names], _importable()),
    )


def _importable() -> list[str]:
    from .functions import importable  # which needs this module for the library's files

    return importable()


def _class(declarations: Declarations, node: ast.ClassDef, sink: DiagnosticSink) -> None:
    source = declarations.source
    record = node.name
    if record not in RECORDS:
        fix = nearest(record, list(RECORDS)) or f"the port classes are {', '.join(RECORDS)}"
        sink.error("E305", f"`{record}` is not a port class", span_of(source, node), help=fix)
        declarations.wrong.add(record)
        record = misspelt(record, [r for r in RECORDS if not declarations.ports[RECORDS[r]]])
        if not record:
            declarations.wrong.update(ast.unparse(s.target) for s in node.body if isinstance(s, ast.AnnAssign))
            return
        declarations.misspelt[node.name] = record  # read on as if it were written so
    if node.bases or node.keywords or node.decorator_list:
        sink.error(
            "E305", "a port class has no bases and no decorators", span_of(source, node), help=f"class {node.name}:"
        )
    ports = declarations.ports[RECORDS[record]]
    seen: dict[str, Span] = {}
    for statement in node.body:
        span = span_of(source, statement)
        if isinstance(statement, ast.Pass) or (
            isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
        ):
            continue
        if not (isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name)):
            sink.error("E306", "a port is declared as `name: type`", span, help='such as `theta: "f64 rad"`')
            continue
        name = statement.target.id
        declarations.wrong.add(name)
        if statement.value is not None:
            fix = "values come from the machine JSON; state is set in `start`"
            sink.error("E306", "a port has no default value", span, help=fix)
            continue
        if name in seen:
            notes = [(seen[name], "first here")]
            sink.error("E302", f"`{name}` is declared twice", span, help="remove one of the two", notes=notes)
            continue
        seen[name] = span
        if not _port_name(record, name, span, sink):
            continue
        parsed = _port_type(source, statement.annotation, record, declarations.names, sink)
        if parsed is None:
            continue
        type_, unit, bounds = parsed
        if (
            type_ == REQUEST
            or (type_ == HEALTH and record != "Inputs")
            or type_ != element_of(type_) in (REQUEST, HEALTH)
        ):
            fix = "every output record has transition_request and health; an input can be a single Health"
            sink.error("E301", f"{RECORDS[record]} cannot hold a {type_}", span, help=fix)
            continue
        ports.append(ir.Port(name, type_, unit, trailing_comment(source, statement), span, bounds))
        declarations.wrong.discard(name)


def _port_name(class_name: str, name: str, span: Span, sink: DiagnosticSink) -> bool:
    if class_name == "Outputs":
        why = "every output becomes a field of a ROS 2 message"
        if name in _RESERVED_OUTPUTS:
            fix = "every algorithm has it already" if name in _RESERVED_OUTPUTS[:2] else "every message has one already"
        elif name in C_KEYWORDS:
            fix = "it is a word of C or C++; use another name"
        elif not _SNAKE.fullmatch(name):
            fix = "write it in lower_snake_case"
        else:
            return True
        sink.error("E307", f"`{name}` cannot be the name of an output", span, why=why, help=fix)
        return False
    if name.startswith("_"):
        sink.error("E307", f"`{name}` cannot be the name of a port", span, help="begin it with a letter")
        return False
    return True


def _free(declarations: Declarations, name: str, span: Span, sink: DiagnosticSink) -> bool:
    """False after reporting that a constant or function of this name cannot be defined."""
    if name in LANGUAGE_NAMES:
        sink.error("E302", f"`{name}` is a name of the language", span, help="use another name")
    elif name in declarations.names.structs:
        sink.error("E302", f"`{name}` is a struct of the machine", span, help="use another name")
    elif name in declarations.defined:
        notes = [(declarations.defined[name], "first here")]
        sink.error("E302", f"`{name}` is defined twice", span, help="use another name", notes=notes)
    else:
        declarations.defined[name] = span
        return True
    return False


def _function(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> None:
    from .externs import is_extern, read_extern

    if not is_extern(node):
        declarations.functions[node.name] = node
        return
    extern = read_extern(declarations, node, sink)
    if extern is None:
        declarations.wrong.add(node.name)
    else:
        declarations.externs[node.name] = extern


def _constant(declarations: Declarations, node: ast.Assign | ast.AnnAssign, sink: DiagnosticSink) -> None:
    from .constants import check_constant

    target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
    span = span_of(declarations.source, node)
    if (
        not isinstance(target, ast.Name)
        or node.value is None
        or (isinstance(node, ast.Assign) and len(node.targets) > 1)
    ):
        sink.error("E303", "this is not a module constant", span, help="write `NAME = value`, one name a line")
        return
    if not _free(declarations, target.id, span, sink):
        return
    declarations.wrong.add(target.id)
    annotation = node.annotation if isinstance(node, ast.AnnAssign) else None
    check_constant(declarations, target.id, annotation, node.value, sink)
