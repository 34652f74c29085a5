# SPDX-License-Identifier: Apache-2.0
"""Constants of a machine JSON, and expressions of them in the place of numbers."""

from __future__ import annotations

import ast
import json
import math
import operator
from collections.abc import Callable, Mapping
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


def constants_of(config: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The values of the constants of a machine JSON that the compiler has accepted."""
    declared = config.get("constants", {})
    if isinstance(declared, str):
        package, slash, inside = declared.removeprefix("package://").partition("/")
        path = package_share(package) / inside if declared.startswith("package://") and slash else folder / declared
        declared = json.loads(path.read_text("utf-8"))
    found: dict[str, Any] = {}
    for name, given in declared.items():
        found[name] = value_of(given["value"] if isinstance(given, dict) else given, found)
    return found


def value_of(value: Any, constants: Mapping[str, Any]) -> Any:
    """A number, or the value of an expression."""
    return _value(ast.parse(value.strip(), mode="eval").body, constants) if isinstance(value, str) else value


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
