# SPDX-License-Identifier: Apache-2.0
"""Python source text to a syntax tree, without running any of it."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Iterator

from .diagnostics import DiagnosticSink
from .source import MAX_NAME, SourceFile, Span

#: Deeper expressions are refused, so that no input can exhaust the stack of a later pass.
MAX_DEPTH = 100


def parse_python(source: SourceFile, sink: DiagnosticSink) -> ast.Module | None:
    """Parses the text. Reports E110 and returns None when it is not Python, or nested too deeply."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of escapes in strings, which the language does not have
            # The parser looks for the text of an erroneous line in the file of this name.
            tree = ast.parse(source.text, source.path or "<source>")
    except SyntaxError as error:
        line = min(max(error.lineno or 1, 1), source.text.count("\n") + 1)
        column = min(max(error.offset or 1, 1), len(source.line(line)) + 1)
        span = Span(source, line, column, line, column + 1)
        sink.error("E110", f"not valid Python: {error.msg}", span)
        return None
    except (RecursionError, MemoryError, ValueError):
        fix = "name the parts with locals or helper functions"
        sink.error("E110", "nested too deeply to be read", _longest_line(source), help=fix)
        return None
    before = sink.errors
    odd: list[tuple[Span, str]] = []
    for node, depth in _nodes(tree):
        if depth > MAX_DEPTH and isinstance(node, ast.expr | ast.stmt):
            fix = "name the parts with locals or helper functions"
            sink.error("E110", f"nested deeper than {MAX_DEPTH} levels", span_of(source, node), help=fix)
            return None
        name = _identifier(node)
        if not (name.isascii() and len(name) <= MAX_NAME) and isinstance(
            node, ast.expr | ast.stmt | ast.arg | ast.alias
        ):
            odd.append((span_of(source, node), name))
    said: set[str] = set()
    for span, name in sorted(odd, key=lambda o: o[0].key):
        if name in said:
            continue
        said.add(name)
        message = f"`{name[:40]}…` is longer than {MAX_NAME} characters" if name.isascii() else f"`{name}` is not ASCII"
        fix = "use a shorter name" if name.isascii() else "use the letters a to z"
        sink.error("E111", message, span, why="every name becomes a C identifier", help=fix)
    return tree if sink.errors == before else None


def _longest_line(source: SourceFile) -> Span:
    """Where the parser has given up without saying where: nearly always in one endless expression."""
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
    return node.name if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.alias) else ""


def _nodes(tree: ast.Module) -> Iterator[tuple[ast.AST, int]]:
    """Every node with its depth, without operators and contexts; ast.walk takes three times as long."""
    stack: list[tuple[ast.AST, int]] = [(tree, 0)]
    while stack:
        node, depth = stack.pop()
        yield node, depth
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, list):
                stack.extend((item, depth + 1) for item in value if isinstance(item, ast.AST))
            elif isinstance(value, ast.AST) and value._fields:
                stack.append((value, depth + 1))


def span_of(source: SourceFile, node: ast.expr | ast.stmt | ast.arg | ast.keyword | ast.alias) -> Span:
    """Span of a node; the tree counts UTF-8 bytes, spans count characters."""
    end_line = node.end_lineno or node.lineno
    end_offset = node.end_col_offset if node.end_col_offset is not None else node.col_offset + 1
    return Span(
        source,
        node.lineno,
        _column(source, node.lineno, node.col_offset),
        end_line,
        _column(source, end_line, end_offset),
    )


def _column(source: SourceFile, line: int, offset: int) -> int:
    text = source.line(line)
    return offset + 1 if text.isascii() else len(text.encode()[:offset].decode(errors="ignore")) + 1


def trailing_comment(source: SourceFile, node: ast.stmt) -> str:
    """The comment behind a one-line statement, without `#`; "" when there is none."""
    span = span_of(source, node)
    rest = source.line(span.end_line)[span.end_column - 1 :].strip()
    return rest.lstrip("#").strip() if rest.startswith("#") else ""
