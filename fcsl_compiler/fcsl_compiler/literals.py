# SPDX-License-Identifier: Apache-2.0
"""Literals that have not met a type yet, and their exact arithmetic."""

from __future__ import annotations

import math
import struct

from .types import F32, F64, I64, Scalar

INT_LITERAL = Scalar("integer literal", "", "", "", 0)
FLOAT_LITERAL = Scalar("float literal", "", "", "", 0)


class LiteralError(ValueError):
    """A literal that cannot be what its place wants; args are the message and a hint."""


def is_literal(type_: object) -> bool:
    return type_ is INT_LITERAL or type_ is FLOAT_LITERAL


def default_type(literal: Scalar) -> Scalar:
    """What a bare literal becomes when nothing else decides."""
    return I64 if literal is INT_LITERAL else F64


def fit(value: int | float, literal: Scalar, target: Scalar) -> int | float:
    """The literal as a value of `target`. Raises LiteralError."""
    if target.is_integer:
        if literal is FLOAT_LITERAL:
            raise LiteralError(
                f"a float literal where {target} is needed",
                "write f64(…) around what it meets, or an integer",
            )
        assert isinstance(value, int)
        if not target.low <= value <= target.high:
            raise LiteralError(f"{value} does not fit {target}", f"{target} holds {target.low} to {target.high}")
        return value
    try:
        number = float(value)
    except OverflowError:
        raise LiteralError(f"the literal is beyond the range of {target}", "an infinity is written `inf`") from None
    if target is F32:
        number = round_f32(number)
        if math.isinf(number) and not math.isinf(float(value)):
            raise LiteralError("the literal is beyond the range of f32", "an infinity is written `inf`")
    if literal is INT_LITERAL and number != value:
        raise LiteralError(f"{value} is not exactly representable in {target}", "write a float literal to say so")
    return number


def round_f32(number: int | float) -> float:
    """The nearest binary32 value, as a float. Integers are rounded once: by way of f64 they could be rounded twice."""
    if isinstance(number, int):
        # What f64 has no digits for makes the last one odd: then it is no tie, and lies on its side of one.
        shift = max(0, number.bit_length() - 50)
        number = float(number >> shift << shift | ((number & ((1 << shift) - 1) != 0) << shift))
    try:
        result: float = struct.unpack("<f", struct.pack("<f", number))[0]
        return result
    except OverflowError:
        return math.copysign(math.inf, number)


#: Larger integer literals have no use on a control path and would make folding slow.
_MAX_BITS = 4096


def fold(symbol: str, left: int | float, right: int | float) -> tuple[int | float, Scalar]:
    """Exact arithmetic on literals, as CPython does it. Raises LiteralError."""
    both_int = isinstance(left, int) and isinstance(right, int)
    if symbol == "/" and both_int:
        raise LiteralError("`/` between two integers", "write `//` for the floor, or f64(…) / f64(…)")
    try:
        value = _apply(symbol, left, right)
    except ZeroDivisionError:
        raise LiteralError("division by zero", "the divisor is a constant zero") from None
    except OverflowError:
        raise LiteralError("the constant is too large", "no type of the language holds it") from None
    if isinstance(value, complex) or (isinstance(value, int) and value.bit_length() > _MAX_BITS):
        raise LiteralError("the constant is too large", "no type of the language holds it")
    return value, INT_LITERAL if isinstance(value, int) else FLOAT_LITERAL


def _apply(symbol: str, left: int | float, right: int | float) -> int | float:
    if symbol == "+":
        return left + right
    if symbol == "-":
        return left - right
    if symbol == "*":
        return left * right
    if symbol == "/":
        return left / right
    if symbol == "//":
        return left // right
    if symbol == "%":
        return left % right
    raise LiteralError(f"`{symbol}` between constants", "write the result")
