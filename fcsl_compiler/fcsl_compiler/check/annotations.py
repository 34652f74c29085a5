# SPDX-License-Identifier: Apache-2.0
"""Parses types in annotations and port dictionaries."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterable

from ..base.diagnostics import DiagnosticSink
from ..base.source import SourceFile
from ..model.types import Type, TypeNames, TypeSyntaxError, parse_type, results_of
from ..parse.python_source import span_of

#: A size in a type.
SIZE = re.compile(r"\[\s*(\w+)\s*\]")
#: Maximum number of characters of a type with its unit and range.
MAX_TYPE = 200


def annotation_type(
    source: SourceFile, node: ast.expr, names: TypeNames, allow_unit: bool, sink: DiagnosticSink
) -> tuple[Type, str] | None:
    """Type and unit of an annotation: a string, a name, or `f64[3]`. Returns None after reporting E301."""
    text = annotation_text(node)
    if text is None or len(text) > MAX_TYPE:
        sink.error("E301", "this is not a type", span_of(source, node), help='write `f64`, or a string: "f64[3] rad/s"')
        return None
    try:
        return parse_type(text, names, allow_unit)
    except TypeSyntaxError as error:
        sink.error("E301", str(error.args[0]), span_of(source, node), help=str(error.args[1]))
        return None


def result_type(source: SourceFile, node: ast.expr, names: TypeNames, sink: DiagnosticSink) -> Type | None:
    """Result type of a helper: one type, or `tuple[f64, "f64[3]"]`. Returns None after reporting E301."""
    if not (isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "tuple"):
        found = annotation_type(source, node, names, False, sink)
        return found[0] if found is not None else None
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    if len(parts) < 2:
        sink.error("E301", "a tuple of one result", span_of(source, node), help=f"write `{ast.unparse(parts[0])}`")
        return None
    types = [annotation_type(source, part, names, False, sink) for part in parts]
    found_types = tuple(t[0] for t in types if t is not None)
    return results_of(found_types) if len(found_types) == len(parts) else None


def sizes_in(texts: Iterable[str], defined: Collection[str]) -> list[str]:
    """The lower-case names in the sizes of these types that are not `defined`: size variables."""
    found = dict.fromkeys(size for text in texts for size in SIZE.findall(text))
    return [size for size in found if size[0].isalpha() and size.islower() and size not in defined]


def annotation_text(node: ast.expr) -> str | None:
    """Text of an annotation, quoted or not. None if the expression cannot be a type."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.Name | ast.Subscript):
        return ast.unparse(node).replace("(", "").replace(")", "")
    return None
