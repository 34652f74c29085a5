# SPDX-License-Identifier: Apache-2.0
"""Bounds of integer expressions, from types, loop bounds and constants. They decide which checks the generated code
needs."""

from __future__ import annotations

from ..model import ir
from ..model.effects import can_fault
from ..model.ops import Op
from ..model.types import Scalar

Interval = tuple[int, int]


def interval(expr: ir.Expr) -> Interval | None:
    """Bounds of an integer expression, provided it did not fault. At worst the bounds of its type. None if it is not an
    integer."""
    if isinstance(expr, ir.Const):
        return (expr.value, expr.value) if type(expr.value) is int else None
    if isinstance(expr, ir.RangeVar):
        return expr.low, expr.high
    if isinstance(expr, ir.Local) and expr.bounds is not None:
        return expr.bounds
    if not (isinstance(expr.type, Scalar) and expr.type.is_integer):
        return None
    whole = (expr.type.low, expr.type.high)
    if isinstance(expr, ir.Choose):
        then, otherwise = interval(expr.then) or whole, interval(expr.otherwise) or whole
        return min(then[0], otherwise[0]), max(then[1], otherwise[1])
    if not isinstance(expr, ir.Apply):
        return whole
    bounds = exact(expr.op, expr.args)
    if bounds is None or fits(expr.op, bounds):
        return bounds or whole
    if not (expr.op.faults or expr.op.name.startswith("sat_")):
        return whole  # the operation wraps
    low, high = max(bounds[0], whole[0]), min(bounds[1], whole[1])
    return (low, high) if low <= high else whole


def always(condition: ir.Expr) -> bool:
    """Whether a condition holds for all values within the bounds of its integers."""
    if isinstance(condition, ir.Const):
        return condition.value is True
    if isinstance(condition, ir.Choose):  # `and`, `or`
        return always(condition.then) and (always(condition.condition) or always(condition.otherwise))
    if not isinstance(condition, ir.Apply) or len(condition.args) != 2:
        return False
    left, right = map(interval, condition.args)
    if left is None or right is None or condition.fault or any(map(can_fault, condition.args)):
        return False
    tests = {"<": left[1] < right[0], "<=": left[1] <= right[0], ">": left[0] > right[1], ">=": left[0] >= right[1]}
    tests["!="] = left[1] < right[0] or right[1] < left[0]
    return tests.get(condition.op.name, False)


def is_static(expr: ir.Expr) -> bool:
    """True if only constants and loop variables determine the expression."""
    if isinstance(expr, ir.Apply):
        return all(is_static(a) for a in expr.args)
    return isinstance(expr, ir.Const | ir.RangeVar)


def fits(op: Op, bounds: Interval) -> bool:
    """True if all values within these bounds are representable, so that no wrap or fault check is needed."""
    return op.result.low <= bounds[0] and bounds[1] <= op.result.high


def exact(op: Op, args: tuple[ir.Expr, ...]) -> Interval | None:
    """Bounds of the exact mathematical result, before any wrap or check. None if no rule exists for the operation."""
    if not op.result.is_integer:
        return None
    known = [b for b in map(interval, args) if b is not None]
    if len(known) != len(args):
        return None
    name = op.name.removeprefix("wrap_").removeprefix("sat_")
    if name.startswith("**"):
        return _power(known[0], int(name[2:]))
    if len(known) == 1:
        return _unary(name, op.result, known[0])
    if name == "clamp":
        x, low, high = known
        return min(max(x[0], low[0]), high[0]), min(max(x[1], low[1]), high[1])
    return _binary(name, known[0], known[1])


def _unary(name: str, type_: Scalar, operand: Interval) -> Interval | None:
    low, high = operand
    if name in ("i32", "i64", "u32", "u64"):
        return operand
    if name == "neg":
        return -high, -low
    if name == "~":
        all_bits = -1 if type_.is_signed else type_.high
        return all_bits - high, all_bits - low
    if name == "abs":
        return max(0, low, -high), max(-low, high)
    if name == "sign":
        return max(-1, min(1, low)), max(-1, min(1, high))
    return None


def _power(base: Interval, exponent: int) -> Interval:
    ends = [base[0] ** exponent, base[1] ** exponent]
    if base[0] < 0 < base[1]:
        ends.append(0**exponent)
    return min(ends), max(ends)


def _binary(name: str, left: Interval, right: Interval) -> Interval | None:
    (a, b), (c, d) = left, right
    if name in ("+", "add"):
        return a + c, b + d
    if name in ("-", "sub"):
        return a - d, b - c
    if name in ("*", "mul"):
        products = (a * c, a * d, b * c, b * d)
        return min(products), max(products)
    if name == "//" and c > 0:
        return min(a // c, a // d), max(b // c, b // d)
    if name == "%" and c > 0:
        return (a, b) if 0 <= a and b < c else (0, d - 1)
    if name == "min":
        return min(a, c), min(b, d)
    if name == "max":
        return max(a, c), max(b, d)
    return _bits(name, left, right)


def _bits(name: str, left: Interval, right: Interval) -> Interval | None:
    (a, b), (c, d) = left, right
    if name == ">>":
        c, d = max(c, 0), min(d, 63)  # other counts fault
        return (min(a >> c, a >> d), max(b >> c, b >> d)) if c <= d else None
    if name == "&" and (a >= 0 or c >= 0):
        return 0, min(high for low, high in (left, right) if low >= 0)
    if name in ("|", "^") and a >= 0 and c >= 0:
        return (max(a, c) if name == "|" else 0), (1 << max(b, d).bit_length()) - 1
    return None
