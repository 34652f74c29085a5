# SPDX-License-Identifier: Apache-2.0
"""What an integer expression can be, from loop bounds and constants: decides which checks the generated code needs."""

from __future__ import annotations

from . import ir

Interval = tuple[int, int]


def interval(expr: ir.Expr) -> Interval | None:
    """Bounds of an integer expression, or None when nothing is known."""
    if isinstance(expr, ir.RangeVar):
        return expr.low, expr.high
    if isinstance(expr, ir.Const) and isinstance(expr.value, int) and not isinstance(expr.value, bool):
        return expr.value, expr.value
    if isinstance(expr, ir.Apply):
        if expr.op.name in ("i32", "i64", "u32", "u64"):
            return interval(expr.args[0])
        return combine(expr.op.name, [interval(a) for a in expr.args])
    return None


def combine(name: str, operands: list[Interval | None]) -> Interval | None:
    """Bounds of an operation, before any wrap or check."""
    known = [o for o in operands if o is not None]
    if len(known) != len(operands):
        return None
    if name == "neg":
        return -known[0][1], -known[0][0]
    if name in ("+", "-", "*") and len(known) == 2:
        (a, b), (c, d) = known
        if name == "+":
            return a + c, b + d
        if name == "-":
            return a - d, b - c
        products = (a * c, a * d, b * c, b * d)
        return min(products), max(products)
    return None
