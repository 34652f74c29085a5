# SPDX-License-Identifier: Apache-2.0
"""Structs of a part: reports those that its algorithms use and only other files declare."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping

from ..model.types import Struct
from ..parse.json_reader import ConfigReader
from ..parse.machine_files import ParsedAlgorithm
from ..parse.parts import STRUCTS
from ..parse.python_source import span_of

_NAME = re.compile(r"\s*(\w+)")


def check_structs(algorithm: ParsedAlgorithm, structs: Mapping[str, Struct], reader: ConfigReader) -> None:
    """`structs`: those of the whole machine."""
    for at in algorithm.parts:
        hidden = structs.keys() - reader.scopes[at.source].structs
        for file in algorithm.file.all if hidden and algorithm.file is not None else ():
            class_name = algorithm.class_name if file is algorithm.file else ""
            for name, node in _names(file.tree, class_name) if file.tree is not None else ():
                if name in hidden:
                    fix = f"declare `{name}` in the `structs` of `{at.source.name}`, too"
                    notes = [(at, "an algorithm of a part")]
                    if (declared := structs[name].span) is not None:
                        notes.append((declared, "only another file declares the struct"))
                    message = f"unknown type `{name}`"
                    reader.sink.error("E301", message, span_of(file.source, node), why=STRUCTS, help=fix, notes=notes)


def _names(tree: ast.Module, class_name: str) -> Iterator[tuple[str, ast.expr]]:
    """All names in a file, but of its classes only in this one: those in code, and the types in strings."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name != class_name:
            continue
        for inner in ast.walk(node):
            if isinstance(inner, ast.Name):
                yield inner.id, inner
            for text in _types(inner):
                if isinstance(text, ast.Constant) and (found := _NAME.match(str(text.value))):
                    yield found[1], text


def _types(node: ast.AST) -> list[ast.expr | None]:
    """The types that a declaration names."""
    if isinstance(node, ast.arg | ast.AnnAssign):
        return [node.annotation]
    if isinstance(node, ast.FunctionDef):
        results = node.returns.slice if isinstance(node.returns, ast.Subscript) else node.returns
        return list(results.elts) if isinstance(results, ast.Tuple) else [results]
    return list(node.values) if isinstance(node, ast.Dict) else []
