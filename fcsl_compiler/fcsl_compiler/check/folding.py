# SPDX-License-Identifier: Apache-2.0
"""Folds operations on typed constants. The result equals the result on the target."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from ..model import ir
from ..model.literals import round_f32
from ..model.ops import Op
from ..model.types import F32, Scalar

Number = bool | int | float

_INTEGER: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "//": operator.floordiv,
    "%": operator.mod,
    "<<": operator.lshift,
    ">>": operator.rshift,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
    "~": operator.invert,
    "neg": operator.neg,
    "abs": abs,
    **{f"**{n}": lambda a, n=n: a**n for n in (0, 2, 3, 4)},
}
_COMPARISON: dict[str, Callable[..., bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "not": operator.not_,
}
# For binary32 operands these are exact enough in binary64 that rounding the result again to binary32 is correct.
_FLOAT: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "neg": operator.neg,
    "abs": abs,
}


class DoesNotFit(ValueError):
    """The operation would fault. str() gives the cause."""


def fold(expr: ir.Expr) -> ir.Expr:
    """Folds all operations on constants that the compiler can compute. Raises DoesNotFit."""
    if isinstance(expr, ir.ArrayValue):
        return ir.ArrayValue(expr.type, tuple(map(fold, expr.items)), expr.span)
    if isinstance(expr, ir.StructValue):
        return ir.StructValue(expr.type, tuple(map(fold, expr.items)), expr.span)
    if not isinstance(expr, ir.Apply):
        return expr
    args = tuple(map(fold, expr.args))
    values = [a.value for a in args if isinstance(a, ir.Const) and not isinstance(a.value, str)]
    result = _apply(expr.op, values) if len(values) == len(args) else None
    return expr if result is None else ir.Const(expr.type, result, expr.span)


def _apply(op: Op, values: list[Number]) -> Number | None:
    """Result of the operation. None if the compiler does not fold this operation."""
    target = op.result
    if op.name in _COMPARISON:
        return bool(_COMPARISON[op.name](*values))
    if target.is_integer:
        return _fit(_integer(op, values), op)
    if not target.is_float:
        return None
    if op.name == target.name:
        return _round(values[0], target)
    if op.name == "/":
        return _round(_divide(float(values[0]), float(values[1])), target)
    function = _FLOAT.get(op.name)
    return None if function is None else _round(function(*values), target)


def _integer(op: Op, values: list[Number]) -> int | None:
    if op.name == op.result.name:
        value = values[0]
        if isinstance(value, float) and not math.isfinite(value):
            raise DoesNotFit(f"{value} does not fit {op.result}")
        return int(value)
    if op.name in ("//", "%") and values[1] == 0:
        raise DoesNotFit("division by zero")
    if op.name in ("<<", ">>") and not 0 <= values[1] < op.args[0].size * 8:
        raise DoesNotFit(f"a shift by {values[1]}")
    function = _INTEGER.get(op.name)
    return None if function is None else int(function(*values))


def _fit(value: int | None, op: Op) -> int | None:
    if value is None or op.result.low <= value <= op.result.high:
        return value
    if not op.faults:
        return value & op.result.high
    raise DoesNotFit(f"{value} does not fit {op.result}")


def _round(value: Number, target: Scalar) -> float:
    return round_f32(value) if target is F32 else float(value)


def _divide(a: float, b: float) -> float:
    if b != 0.0 or math.isnan(b):
        return a / b
    if a == 0.0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, math.copysign(1.0, a) * math.copysign(1.0, b))
