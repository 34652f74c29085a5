# SPDX-License-Identifier: Apache-2.0
"""Signatures of the library, read from its source: the functions that return a given type."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import fcsl_compiler

from .types import Array, Type

#: The library is written in the language itself.
FILES = sorted((Path(fcsl_compiler.__file__).parent / "library").glob("*.py"))


@dataclass(frozen=True)
class Pattern:
    """f64, or f64[n][3] with variable (str) and fixed extents."""

    extents: tuple[str | int, ...]

    def bind(self, type_: Type, sizes: dict[str, int]) -> bool:
        """Matches a type. If it matches, stores its sizes in `sizes` and returns True."""
        shape = type_.shape if isinstance(type_, Array) else ()
        if (type_.element if isinstance(type_, Array) else type_) != "f64" or len(shape) != len(self.extents):
            return False
        return all(
            n == extent if isinstance(extent, int) else sizes.setdefault(extent, n) == n
            for extent, n in zip(self.extents, shape, strict=True)
        )

    def at(self, sizes: dict[str, int]) -> Type:
        shape = tuple(e if isinstance(e, int) else sizes[e] for e in self.extents)
        return Array("f64", shape) if shape else "f64"


@dataclass(frozen=True)
class Signature:
    name: str
    args: tuple[Pattern, ...]
    result: Pattern

    @property
    def variables(self) -> list[str]:
        return sorted({e for p in (*self.args, self.result) for e in p.extents if isinstance(e, str)})


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
    assert node
    text = node.value if isinstance(node, ast.Constant) else ast.unparse(node)
    assert isinstance(text, str) and text.startswith("f64"), text
    extents = re.findall(r"\[(\w+)\]", text)
    return Pattern(tuple(int(e) if e.isdigit() else e for e in extents))
