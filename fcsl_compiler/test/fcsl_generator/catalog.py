# SPDX-License-Identifier: Apache-2.0
"""Signatures of the library, read from its source: the functions that return a given type."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import fcsl_compiler

from .types import FLOATS, NUMBERS, Array, Type

#: The library is written in the language itself.
FILES = sorted((Path(fcsl_compiler.__file__).parent / "library").glob("*.py"))


#: What the names of element types in a signature stand for.
ELEMENTS = {"F": FLOATS, "T": NUMBERS}


@dataclass(frozen=True)
class Pattern:
    """F, or T[n][3] with variable (str) and fixed extents. In `sizes` a name of ELEMENTS has a type."""

    element: str
    extents: tuple[str | int, ...]

    def bind(self, type_: Type, sizes: dict[str, Any]) -> bool:
        """Matches a type. If it matches, stores its sizes and element in `sizes` and returns True."""
        shape, element = (type_.shape, type_.element) if isinstance(type_, Array) else ((), type_)
        if element not in ELEMENTS.get(self.element, (self.element,)) or len(shape) != len(self.extents):
            return False
        if sizes.setdefault(self.element, element) != element:
            return False
        return all(
            n == extent if isinstance(extent, int) else sizes.setdefault(extent, n) == n
            for extent, n in zip(self.extents, shape, strict=True)
        )

    def at(self, sizes: dict[str, Any]) -> Type:
        shape = tuple(e if isinstance(e, int) else sizes[e] for e in self.extents)
        element = sizes.get(self.element, self.element)
        return Array(element, shape) if shape else element


@dataclass(frozen=True)
class Signature:
    name: str
    args: tuple[Pattern, ...]
    result: Pattern

    @property
    def variables(self) -> list[str]:
        return sorted({e for p in (*self.args, self.result) for e in p.extents if isinstance(e, str)})

    @property
    def elements(self) -> list[str]:
        """Those of ELEMENTS that its arguments name."""
        return [e for e in ELEMENTS if any(p.element == e for p in self.args)]


@cache
def library() -> tuple[Signature, ...]:
    found = []
    for path in FILES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef):
                args = tuple(_pattern(a.annotation) for a in node.args.args)
                name = node.name.split("__")[0]  # kf_predict_state__4 is kf_predict_state with four arguments
                found.append(Signature(name, args, _pattern(node.returns)))
    return tuple(found)


def _pattern(node: ast.expr | None) -> Pattern:
    assert isinstance(node, ast.Constant)
    extents = re.findall(r"\[(\w+)\]", str(node.value))
    return Pattern(str(node.value).partition("[")[0], tuple(int(e) if e.isdigit() else e for e in extents))
