# SPDX-License-Identifier: Apache-2.0
"""Parses Python source text into a syntax tree. No code is executed."""

from __future__ import annotations

import ast
import io
import tokenize
import warnings
from collections.abc import Iterator

from ..base.diagnostics import DiagnosticSink
from ..base.source import MAX_NAME, SourceFile, Span

#: Maximum depth of expressions. It bounds the use of the stack in later passes. In the chains `a and b and c`, `a < b <
#: c` and `max(a, b, c)`, each operand counts as a level.
MAX_DEPTH = 100

#: Modules that only editors and CPython use, with the names that may be imported from them. None: check/collect.py
#: decides.
EDITOR_MODULES: dict[str, tuple[str, ...] | None] = {
    "__future__": ("annotations",),
    "typing": ("ClassVar",),
    "fcsl_builtins": None,
}


def is_ignored_module(name: str | None) -> bool:
    """Whether only editors and CPython use a module."""
    return name in EDITOR_MODULES


def assigned_fields(method: ast.FunctionDef) -> frozenset[str]:
    """The fields of `self` that a method assigns, wholly or in part."""
    found = set()
    for node in ast.walk(method):
        place: ast.AST = node if isinstance(getattr(node, "ctx", None), ast.Store) else ast.Pass()
        while isinstance(place, ast.Attribute | ast.Subscript):
            if isinstance(place.value, ast.Name) and place.value.id == "self" and isinstance(place, ast.Attribute):
                found.add(place.attr)
            place = place.value
    return frozenset(found)


def parse_python(source: SourceFile, sink: DiagnosticSink) -> ast.Module | None:
    """Parses the text. Returns None after reporting E110, if it is not valid Python or is nested too deeply."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings about escapes in strings, which the language does not allow
            # For the text of an erroneous line, CPython's parser opens the file of this name.
            tree = ast.parse(source.text, source.path or "<source>")
    except SyntaxError as error:
        line = min(max(error.lineno or 1, 1), source.text.count("\n") + 1)
        column = min(max(error.offset or 1, 1), len(source.line(line)) + 1)
        span = Span(source, line, column, line, column + 1)
        sink.error("E110", f"not valid Python: {error.msg}", span)
        return None
    except (RecursionError, MemoryError, ValueError):
        fix = "name the parts with locals or helper functions"
        sink.error("E110", "nested too deeply to be parsed", _longest_line(source), help=fix)
        return None
    before = sink.errors
    odd: list[tuple[Span, str]] = []
    for node, depth in _nodes(tree):
        if depth > MAX_DEPTH and isinstance(node, ast.expr | ast.stmt):
            fix = "name the parts with locals or helper functions"
            message = f"nested deeper than {MAX_DEPTH} levels, or a chain of more operands"
            sink.error("E110", message, span_of(source, node), help=fix)
            return None
        name = _identifier(node)
        if name.isascii() and len(name) > MAX_NAME and isinstance(node, ast.expr | ast.stmt | ast.arg | ast.alias):
            odd.append((span_of(source, node), name))
    odd += _not_ascii(source)
    reported: set[str] = set()
    for span, name in sorted(odd, key=lambda o: o[0].key):
        if name in reported:
            continue
        reported.add(name)
        message = f"`{name[:40]}…` is longer than {MAX_NAME} characters" if name.isascii() else f"`{name}` is not ASCII"
        fix = "use a shorter name" if name.isascii() else "use the letters a to z"
        sink.error("E111", message, span, why="every name becomes a C identifier", help=fix)
    return tree if sink.errors == before else None


def _not_ascii(source: SourceFile) -> list[tuple[Span, str]]:
    """Non-ASCII names as written in the source. The syntax tree contains some of them normalised to ASCII letters."""
    if source.text.isascii():
        return []
    tokens = tokenize.generate_tokens(io.StringIO(source.text).readline)
    names = [t for t in tokens if t.type == tokenize.NAME and not t.string.isascii()]
    return [(Span(source, t.start[0], t.start[1] + 1, t.end[0], t.end[1] + 1), t.string) for t in names]


def _longest_line(source: SourceFile) -> Span:
    """Span for an error that the parser reports without a position: the longest line, which usually contains the
    cause."""
    lines = source.text.split("\n")
    number = max(range(len(lines)), key=lambda n: len(lines[n])) + 1
    return Span(source, number, 1, number, len(lines[number - 1]) + 1)


def _identifier(node: ast.AST) -> str:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return node.attr
    if isinstance(node, ast.arg):
        return node.arg
    if isinstance(node, ast.ImportFrom):
        return max((node.module or "").split("."), key=len)
    return node.name if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.alias) else ""


def _chained(node: ast.AST) -> int:
    """Number of operands beyond the second in a chain that is evaluated pairwise."""
    if isinstance(node, ast.BoolOp):
        return len(node.values) - 2
    if isinstance(node, ast.Compare):
        return len(node.ops) - 1
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        return max(0, len(node.args) - 2)
    return 0


def _nodes(tree: ast.Module) -> Iterator[tuple[ast.AST, int]]:
    """All nodes with their depth, without operators and contexts. Three times as fast as ast.walk."""
    stack: list[tuple[ast.AST, int]] = [(tree, 0)]
    while stack:
        node, depth = stack.pop()
        yield node, depth
        depth += _chained(node)
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, list):
                stack.extend((item, depth + 1) for item in value if isinstance(item, ast.AST))
            elif isinstance(value, ast.AST) and value._fields:
                stack.append((value, depth + 1))


def span_of(source: SourceFile, node: ast.expr | ast.stmt | ast.arg | ast.keyword | ast.alias) -> Span:
    """Span of a node. The syntax tree counts UTF-8 bytes, spans count characters."""
    end_line = node.end_lineno or node.lineno
    end_offset = node.end_col_offset if node.end_col_offset is not None else node.col_offset + 1
    return Span(
        source,
        node.lineno,
        _column(source, node.lineno, node.col_offset),
        end_line,
        _column(source, end_line, end_offset),
    )


def text_of(source: SourceFile, node: ast.Constant) -> str:
    """Source text of a literal on one line."""
    assert node.end_col_offset is not None
    return source.line(node.lineno).encode()[node.col_offset : node.end_col_offset].decode()


def _column(source: SourceFile, line: int, offset: int) -> int:
    text = source.line(line)
    return offset + 1 if text.isascii() else len(text.encode()[:offset].decode(errors="ignore")) + 1
