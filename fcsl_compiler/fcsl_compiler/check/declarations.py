# SPDX-License-Identifier: Apache-2.0
"""Module-level declarations of an algorithm file. collect.py fills them."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from functools import cached_property

from ..base.source import SourceFile, Span
from ..model import ir
from ..model.types import TypeNames
from .algorithm_class import AlgorithmClass
from .scope import Constant


@dataclass
class Declarations:
    """Declarations of one file, with the syntax trees of unchecked bodies."""

    source: SourceFile
    owner: str  # C name prefix of its functions and constants
    names: TypeNames
    classes: dict[str, AlgorithmClass] = field(default_factory=dict)
    constants: dict[str, Constant] = field(default_factory=dict)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    #: Defaults of helpers' arguments by the names of both.
    defaults: dict[tuple[str, str], ir.Const] = field(default_factory=dict)
    externs: dict[str, ir.Extern] = field(default_factory=dict)
    #: Imported helpers by name.
    imported: dict[str, Declarations] = field(default_factory=dict)
    tree: ast.Module = field(default_factory=lambda: ast.Module([], []))
    #: The definition of each module-level name.
    defined: dict[str, Span] = field(default_factory=dict)
    #: Constants, functions and classes with a reported declaration error. Their uses are not reported again.
    wrong: set[str] = field(default_factory=set)
    declared: bool = True  # True if no error was reported in its classes and constants
    sound: bool = True  # True if, in addition, no error was reported in its helpers and in the files it imports from

    def uses_library(self, name: str) -> bool:
        """Whether the file imports this name of the library, calls it, or defines it at module level: then nothing else
        may have it."""
        return name in self.defined or name in self._used_names

    @cached_property
    def _used_names(self) -> frozenset[str]:
        found: set[str] = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.ImportFrom):
                found.update(alias.name for alias in node.names)
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                found.add(node.func.id)
        return frozenset(found)
