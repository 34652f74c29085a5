# SPDX-License-Identifier: Apache-2.0
"""Files of the numeric library as syntax trees, and the names of its functions."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.source import SourceFile
from ..parse.python_source import parse_python

_STEMS = ("linear_algebra", "quaternion", "kalman")


@cache
def library_files() -> tuple[tuple[SourceFile, ast.Module], ...]:
    """Source and syntax tree of each file."""
    files = []
    for stem in _STEMS:
        sink = DiagnosticSink()
        source = SourceFile.read(Path(__file__).parents[1] / "library" / f"{stem}.py", f"<library>/{stem}.py")
        tree = parse_python(source, sink)
        sink.raise_if_failed()
        assert tree
        files.append((source, tree))
    return tuple(files)


@cache
def library_definitions() -> dict[str, ast.FunctionDef]:
    """All function definitions of the library by name. `name__4` is the overload of `name` with four arguments."""
    return {node.name: node for _, tree in library_files() for node in tree.body if isinstance(node, ast.FunctionDef)}


def library_names() -> list[str]:
    """Names that a program can call."""
    return [name for name in library_definitions() if "__" not in name]


def overloads(name: str) -> list[ast.FunctionDef]:
    """The definitions of a library function, one for each number of arguments."""
    return [node for other, node in library_definitions().items() if other.partition("__")[0] == name]
