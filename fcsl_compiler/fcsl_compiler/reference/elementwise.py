# SPDX-License-Identifier: Apache-2.0
"""Operations of arrays of f64, element by element, as functions for one size. None of the arrays is a constant."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Sequence
from typing import Any

from .arrays import Array, ArrayType
from .values import Zero

#: The operator as text, and for arrays that are too long for a function of their own.
OPERATIONS: dict[type[ast.AST], tuple[str, Callable[..., Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.USub: ("-", operator.neg),
}
_LONGEST = 64


def elementwise(op: type[ast.AST], arrays: Sequence[bool], type_: ArrayType) -> Callable[..., Array]:
    """The operation on operands of which these are arrays of this type and the others scalars."""
    sign, general = OPERATIONS[op]
    if type_.count > _LONGEST:
        return general
    names = "ab"[: len(arrays)]
    items = [[f"{n}{i}" if whole else n for i in range(type_.count)] for n, whole in zip(names, arrays, strict=True)]
    lines = [f"[{', '.join(row)}] = {n}.data" for n, row, whole in zip(names, items, arrays, strict=True) if whole]
    if sign == "/":
        divisors = items[1] if arrays[1] else ["b"]
        lines += [f"{b} = {b} or zero({b})" for b in divisors]
    results = (f"{sign}{row[0]}" if len(row) == 1 else f"{row[0]} {sign} {row[1]}" for row in zip(*items, strict=True))
    lines.append(f"return of([{', '.join(results)}])")
    namespace: dict[str, Any] = {"of": type_.of, "zero": Zero}
    exec("def function({}):\n {}".format(", ".join(names), "\n ".join(lines)), namespace)
    function: Callable[..., Array] = namespace["function"]
    return function
