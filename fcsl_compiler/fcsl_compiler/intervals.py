# SPDX-License-Identifier: Apache-2.0
"""What an integer expression can be, from loop bounds and constants: decides which checks the generated code needs."""

from __future__ import annotations

from . import ir
from .ops import Op

Interval = tuple[int, int]

_CONVERSIONS = ("i32", "i64", "u32", "u64")


def interval(expr: ir.Expr) -> Interval | None:
    """Bounds of an integer expression that did not fault, or None when nothing is known."""
    if isinstance(expr, ir.RangeVar):
        return expr.low, expr.high
    if isinstance(expr, ir.Const) and isinstance(expr.value, int) and not isinstance(expr.value, bool):
        return expr.value, expr.value
    if not isinstance(expr, ir.Apply):
        return None
    bounds = exact(expr.op, expr.args)
    if bounds is None or fits(expr.op, bounds):
        return bounds
    if not expr.op.faults:
        return None  # it wrapped
    low, high = max(bounds[0], expr.op.result.low), min(bounds[1], expr.op.result.high)
    return (low, high) if low <= high else None


def fits(op: Op, bounds: Interval) -> bool:
    """True when no value within these bounds needs a wrap or a fault."""
    return op.result.low <= bounds[0] and bounds[1] <= op.result.high


def exact(op: Op, args: tuple[ir.Expr, ...]) -> Interval | None:
    """Bounds of the mathematical result, before any wrap or check."""
    if not op.result.is_integer:
        return None
    known = [b for b in map(interval, args) if b is not None]
    if len(known) != len(args):
        return None
    if op.name in _CONVERSIONS:
        return known[0]
    if op.name == "neg":
        return -known[0][1], -known[0][0]
    if op.name.startswith("**"):
        return _power(known[0], int(op.name[2:]))
    return _binary(op.name, known[0], known[1]) if len(known) == 2 else None


def _power(base: Interval, exponent: int) -> Interval:
    ends = [base[0] ** exponent, base[1] ** exponent]
    if base[0] < 0 < base[1]:
        ends.append(0**exponent)
    return min(ends), max(ends)


def _binary(name: str, left: Interval, right: Interval) -> Interval | None:
    (a, b), (c, d) = left, right
    if name == "+":
        return a + c, b + d
    if name == "-":
        return a - d, b - c
    if name == "*":
        products = (a * c, a * d, b * c, b * d)
        return min(products), max(products)
    if name == "//" and c > 0:
        return min(a // c, a // d), max(b // c, b // d)
    if name == "%" and c > 0:
        return 0, d - 1
    return None
