# SPDX-License-Identifier: Apache-2.0
"""Conversion of literals to values of a type."""

from __future__ import annotations

import math
import struct
from fractions import Fraction

from .types import F32, Scalar

#: Type of a string literal, the name of a request or a health. The context decides which.
STRING_LITERAL = Scalar("string", "", "", "", 0)


class LiteralError(ValueError):
    """A literal that does not fit its type. args: message text and help text."""


def fit(value: int | float, target: Scalar) -> int | float:
    """A number as a value of `target`. A float never becomes an integer. Raises LiteralError."""
    if target.is_integer:
        if isinstance(value, float):
            fix = "convert the other operand with f64(…), or write an integer"
            if value.is_integer():
                fix = f"write {int(value)}, or convert the other operand with f64(…)"
            raise LiteralError(f"a float literal where {target} is needed", fix)
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
    if isinstance(value, int) and number != value:
        raise LiteralError(
            f"{value} is not exactly representable in {target}", "write a float literal if rounding is intended"
        )
    return number


def round_f32(number: int | float) -> float:
    """The nearest binary32 value, as a float. Integers are rounded once; conversion via f64 could round twice."""
    if isinstance(number, int):
        # Digits beyond f64 set the last bit. The value is then never a tie, and rounds to the correct side.
        shift = max(0, number.bit_length() - 50)
        number = float(number >> shift << shift | ((number & ((1 << shift) - 1) != 0) << shift))
    try:
        result: float = struct.unpack("<f", struct.pack("<f", number))[0]
        return result
    except OverflowError:
        return math.copysign(math.inf, number)


def decimal_f32(text: str) -> float:
    """The binary32 value nearest to a decimal literal, rounded once; conversion via f64 could round twice."""
    exact, near = Fraction(text), float(text)
    if math.isfinite(near) and Fraction(near) != exact and not _is_odd(near):
        near = math.nextafter(near, math.inf if exact > Fraction(near) else -math.inf)
    return round_f32(near)


def _is_odd(number: float) -> bool:
    """Whether the last bit of an f64 is 1. Such a value is not a tie between two f32 values."""
    bits: int = struct.unpack("<q", struct.pack("<d", number))[0]
    return bits & 1 == 1
