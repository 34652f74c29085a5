# SPDX-License-Identifier: Apache-2.0
"""The value of a checked expression: of scalars here, of whole columns with functions that a caller gives."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .tree import ExpressionError, Kind, Node

#: Gives the value of a leaf: a field, a column or a metric. A vector is a list.
Source = Callable[[Node], Any]
Value = Callable[[Source], Any]

_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    **{"==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge},
}


@dataclass(frozen=True)
class Arithmetic:
    """`functions` by operator or name. `lazy`: `and`, `or` and chains leave out what no longer matters; else these are functions,
    too. `widen` makes a scalar fit beside a vector."""

    functions: Mapping[str, Callable[..., Any]]
    lazy: bool
    widen: Callable[[Any], Any]


def evaluator(node: Node, arithmetic: Arithmetic) -> Value:
    """A function from a source of values to the value of `node`. It raises ExpressionError where there is none."""
    if node.operator == "literal":
        return lambda source: node.value
    if node.operator in ("field", "column", "metric"):
        is_integer = node.quantity.kind is Kind.INTEGER and arithmetic.lazy
        return (lambda source: _fits(source(node))) if is_integer else (lambda source: source(node))
    parts = [evaluator(part, arithmetic) for part in node.parts]
    if node.operator == "compare":
        return _compare(node.value, parts, arithmetic)
    if node.operator in ("in", "not in"):
        return _member(node.operator == "in", parts, arithmetic)
    if node.operator in ("and", "or") and arithmetic.lazy:
        join = all if node.operator == "and" else any
        return lambda source: join(part(source) for part in parts)
    function = arithmetic.functions[node.operator]
    if node.quantity.shape:
        parts = [
            part if below.quantity.shape else _widened(part, arithmetic)
            for part, below in zip(parts, node.parts, strict=True)
        ]
    if len(parts) == 1:
        (only,) = parts
        return lambda source: function(only(source))
    return lambda source: function(*[part(source) for part in parts])


def _widened(part: Value, arithmetic: Arithmetic) -> Value:
    return lambda source: arithmetic.widen(part(source))


def _compare(operators: tuple[str, ...], parts: list[Value], arithmetic: Arithmetic) -> Value:
    first, *others = parts
    rest = [(_COMPARISONS[op], part) for op, part in zip(operators, others, strict=True)]

    def chain(source: Source) -> bool:
        left = first(source)
        for compare, part in rest:
            right = part(source)
            if not compare(left, right):
                return False
            left = right
        return True

    def all_of(source: Source) -> Any:
        values = [part(source) for part in parts]
        pairs = [compare(a, b) for (compare, _), a, b in zip(rest, values, values[1:], strict=False)]
        return pairs[0] if len(pairs) == 1 else arithmetic.functions["and"](*pairs)

    return chain if arithmetic.lazy else all_of


def _member(wanted: bool, parts: list[Value], arithmetic: Arithmetic) -> Value:
    part, *items = parts

    def found(source: Source) -> Any:
        value = part(source)
        return (value in [item(source) for item in items]) is wanted

    def all_found(source: Source) -> Any:
        value = part(source)
        equal = [value == item(source) for item in items]
        one = equal[0] if len(equal) == 1 else arithmetic.functions["or"](*equal)
        return one if wanted else arithmetic.functions["not"](one)

    return found if arithmetic.lazy else all_found


# ---- scalars: Python's numbers, where integers have 64 bits ----------------------------------------------------------------

_EXACT_MAX = 2**53  # integers up to here are doubles, too


def _fits(value: Any) -> Any:
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ExpressionError("the result does not fit 64 bits")
    return value


def _divisor(value: Any) -> Any:
    if value == 0:
        raise ExpressionError("division by zero")
    return value


def _divide(a: Any, b: Any) -> float:
    if isinstance(a, int) and isinstance(b, int) and max(abs(a), abs(b)) > _EXACT_MAX:
        _divisor(b)
        raise ExpressionError("integers beyond 2^53 cannot be divided by /")
    return float(a / _divisor(b))


def _power(a: Any, b: Any) -> float:
    """C's pow; not a number, and too large, are errors."""
    try:
        return math.pow(a, b)
    except (ValueError, OverflowError):
        raise ExpressionError(f"{a} ** {b} is no number, or too large") from None


def _sqrt(x: Any) -> float:
    if x < 0:
        raise ExpressionError("the square root of a negative number")
    return math.sqrt(x)


def _norm(vector: list[Any]) -> float:
    total = 0.0
    for x in vector:
        total += float(x) * float(x)
    return math.sqrt(total)


def _each(function: Callable[..., Any]) -> Callable[..., Any]:
    """Of vectors element by element, beside which a scalar stands for a vector of it."""

    def apply(*values: Any) -> Any:
        size = next((len(value) for value in values if isinstance(value, list)), None)
        if size is None:
            return function(*values)
        rows = [value if isinstance(value, list) else [value] * size for value in values]
        return [function(*row) for row in zip(*rows, strict=True)]

    return apply


SCALARS = Arithmetic(
    {
        **{
            "+": _each(lambda a, b: _fits(a + b)),
            "-": _each(lambda a, b: _fits(a - b)),
            "*": _each(lambda a, b: _fits(a * b)),
        },
        **{
            "/": _each(_divide),
            "//": _each(lambda a, b: _fits(a // _divisor(b))),
            "%": _each(lambda a, b: a % _divisor(b)),
        },
        **{"**": _each(_power), "negative": _each(lambda a: _fits(-a)), "positive": _each(operator.pos)},
        **{"abs": _each(lambda a: _fits(abs(a))), "sqrt": _each(_sqrt), "degrees": _each(math.degrees)},
        **{
            "min": _each(lambda *v: min(map(operator.pos, v))),
            "max": _each(lambda *v: max(map(operator.pos, v))),
            "norm": _norm,
        },
        **{"isnan": math.isnan, "isfinite": math.isfinite, "not": operator.not_},
    },
    lazy=True,
    widen=lambda value: value,
)
