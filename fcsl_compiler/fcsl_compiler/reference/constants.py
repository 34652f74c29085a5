# SPDX-License-Identifier: Apache-2.0
"""What stands in the place of numbers in a machine JSON: expressions of its constants, columns of CSV files."""

from __future__ import annotations

import ast
import csv
import json
import math
import operator
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from ..base.packages import package_share

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: lambda a, b: float(a) ** b,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs,
    "min": min,
    "max": max,
    "sqrt": math.sqrt,
    "degrees": math.degrees,
}


class Literals:
    """Values of a machine JSON that the compiler has accepted; files that it names are relative to `folder`. Texts with a
    `part` are of the file of that part."""

    def __init__(self, config: Mapping[str, Any], folder: Path):
        self._folder = folder
        self._parts = {
            name: Literals(part, Path(part["path"]).parent) for name, part in config.get("parts", {}).items()
        }
        self._constants: dict[str, Any] = {}
        declared = config.get("constants", {})
        if isinstance(declared, str):
            declared = json.loads(self._path(declared).read_text("utf-8"))
        for name, given in declared.items():
            self._constants[name] = self.number(given["value"] if isinstance(given, dict) else given)

    def number(self, value: Any) -> Any:
        """A number, or the value of an expression."""
        if not isinstance(value, str):
            return value
        own = self._parts.get(getattr(value, "part", ""), self)
        return _value(ast.parse(value.strip(), mode="eval").body, own._constants)

    def column(self, csv_file: str, column: str, integers: bool = False) -> list[int] | list[float]:
        """The numbers of a column."""
        own = self._parts.get(getattr(csv_file, "part", ""), self)
        with own._path(csv_file).open(encoding="utf-8-sig", newline="") as stream:
            rows = [[cell.strip() for cell in row] for row in csv.reader(stream) if any(map(str.strip, row))]
        at = rows[0].index(column)
        cells = [row[at] for row in rows[1:]]
        return [int(Fraction(cell)) for cell in cells] if integers else [float(cell) for cell in cells]

    def _path(self, name: str) -> Path:
        package, slash, inside = name.removeprefix("package://").partition("/")
        return package_share(package) / inside if name.startswith("package://") and slash else self._folder / name


def _value(node: ast.expr, constants: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.Name):
        return constants[node.id]
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, constants))
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_value(node.left, constants), _value(node.right, constants))
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    return _FUNCTIONS[node.func.id](*(_value(argument, constants) for argument in node.args))
