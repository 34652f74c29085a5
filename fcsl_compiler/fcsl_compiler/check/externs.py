# SPDX-License-Identifier: Apache-2.0
"""`@extern(header="cpu_temp.h")`: the declaration of a function of C or Nim that an algorithm calls."""

from __future__ import annotations

import ast
import re

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.c_names import c_name
from ..model.types import HEALTH, REQUEST, Struct, Type, element_of, leaves, scalar_of
from ..parse.python_source import span_of
from .annotations import annotation_type
from .declarations import Declarations
from .scope import LANGUAGE_NAMES

_HEADER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*\.h")
_NIM_FILE = re.compile(r"[A-Za-z][A-Za-z0-9_]*\.nim")
_SHAPE = 'write `@extern(header="name.h")` above `def name(x: f64) -> f64: ...`'


def is_extern(node: ast.FunctionDef) -> bool:
    return any(_name(d.func if isinstance(d, ast.Call) else d) == "extern" for d in node.decorator_list)


def read_extern(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> ir.Extern | None:
    """The declared function. Returns None after reporting E435 (the declaration) or E301 (a type)."""
    span = span_of(declarations.source, node)
    at = Span(span.source, span.line, span.column, span.line, span.column + len("def ") + len(node.name))
    found = _header(declarations, node, sink)
    if found is None:
        return None
    header, language = found
    if c_name(node.name) != node.name or node.name in LANGUAGE_NAMES:
        sink.error("E435", f"`{node.name}` is a name of C or of FCSL", at, help="wrap the function under another name")
        return None
    if not _is_stub(node.body):
        fix = "write `...` as its body"
        sink.error("E435", "an extern has no body: C defines it", span_of(declarations.source, node.body[0]), help=fix)
        return None
    a = node.args
    if a.defaults or a.kwonlyargs or a.vararg or a.kwarg or a.posonlyargs:
        sink.error("E435", f"`{node.name}` has more than plain arguments", at, help=_SHAPE)
        return None
    arguments: list[tuple[str, Type]] = []
    for argument in a.args:
        if argument.annotation is None:
            where = span_of(declarations.source, argument)
            sink.error("E435", f"argument `{argument.arg}` has no type", where, help=f"such as `{argument.arg}: f64`")
            return None
        type_ = _type(declarations, argument.annotation, sink)
        if type_ is None:
            return None
        arguments.append((argument.arg, type_))
    result: Type | None = None
    if node.returns is None:
        sink.error("E435", f"`{node.name}` has no result type", at, help="write `-> f64`, or `-> None`")
        return None
    if not (isinstance(node.returns, ast.Constant) and node.returns.value is None):
        result = _type(declarations, node.returns, sink)
        if result is None:
            return None
    made = ir.Extern(node.name, header, tuple(arguments), result, at, language)
    types = [type_ for _, type_ in arguments] + ([] if result is None else [result])
    struct = next((element for t in types if isinstance(element := element_of(t), Struct)), None)
    if struct is not None and language == "nim":
        fix = "pass its members, or write the function in C"
        sink.error(
            "E435",
            f"`{node.name}` is written in Nim, which has no type for the struct `{struct}`",
            at,
            help=fix,
        )
        return None
    return made


def _header(declarations: Declarations, node: ast.FunctionDef, sink: DiagnosticSink) -> tuple[str, str] | None:
    """The header, or the file in Nim, and the language."""
    decorator = node.decorator_list[0]
    span = span_of(declarations.source, decorator)
    given: dict[str, object] = {}
    if len(node.decorator_list) == 1 and isinstance(decorator, ast.Call) and not decorator.args:
        given = {k.arg or "": k.value.value for k in decorator.keywords if isinstance(k.value, ast.Constant)}
        given = given if len(given) == len(decorator.keywords) else {}
    header = given.get("header")
    if not isinstance(header, str) or not given.keys() <= {"header", "lang"}:
        sink.error("E435", "not a valid extern declaration", span, help=_SHAPE)
    elif given.get("lang", "c") not in ("c", "nim"):
        sink.error(
            "E435", f"`{given['lang']}` is not a language of externs", span, help='write `lang="c"` or `lang="nim"`'
        )
    elif given.get("lang") == "nim":
        if _NIM_FILE.fullmatch(header):
            return header, "nim"
        fix = "the name of one of the target's `sources`, such as `board.nim`"
        sink.error("E435", f"`{header}` is not a file in Nim", span, help=fix)
    elif not _HEADER.fullmatch(header) or ".." in header:
        fix = "a path below the include folders of the target, such as `board/cpu_temp.h`"
        sink.error("E435", f"`{header}` is not a header", span, help=fix)
    else:
        return header, "c"
    return None


def _is_stub(body: list[ast.stmt]) -> bool:
    """Whether a body is `...`, a docstring, or both."""
    constants = [s.value.value for s in body if isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant)]
    return len(constants) == len(body) <= 2 and all(c is ... or isinstance(c, str) for c in constants)


def _type(declarations: Declarations, node: ast.expr, sink: DiagnosticSink) -> Type | None:
    parsed = annotation_type(declarations.source, node, declarations.names, False, sink)
    if parsed is None:
        return None
    word = next((s for leaf in leaves(parsed[0]) if (s := scalar_of(leaf.type)) in (REQUEST, HEALTH)), None)
    if word is not None:
        at = span_of(declarations.source, node)
        sink.error("E435", f"{word} has no C type", at, help="pass numbers, bools, arrays or structs of them")
        return None
    return parsed[0]


def _name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else ""
