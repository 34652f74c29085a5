# SPDX-License-Identifier: Apache-2.0
"""Files of the numeric library as syntax trees, and the names of its functions."""

from __future__ import annotations

import ast
import copy
from functools import cache
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.source import SourceFile
from ..model.types import ELEMENTS
from ..parse.python_source import parse_python

_STEMS = ("linear_algebra", "quaternion", "kalman", "arrays", "tables")


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
    """Names that a program can call. `min` and `max` are builtins, too."""
    return list(dict.fromkeys(name.partition("__")[0] for name in library_definitions()))


@cache
def of_elements(node: ast.FunctionDef, element: str) -> ast.FunctionDef:
    """A library function for elements of this type, in the place of F or T."""
    made = copy.deepcopy(node)
    for part in ast.walk(made):
        if isinstance(part, ast.Name) and part.id in ELEMENTS:
            part.id = element
    for annotation in (*(a.annotation for a in made.args.args), made.returns):
        if isinstance(annotation, ast.Constant):
            name, bracket, sizes = str(annotation.value).partition("[")
            annotation.value = f"{element if name in ELEMENTS else name}{bracket}{sizes}"
    return made


def overloads(name: str) -> list[ast.FunctionDef]:
    """The definitions of a library function, one for each number of arguments."""
    return [node for other, node in library_definitions().items() if other.partition("__")[0] == name]
