# SPDX-License-Identifier: Apache-2.0
"""Numbers as they are written: whether one is a value of a type, and which."""

from __future__ import annotations

import math
import struct
from fractions import Fraction

from .types import F32, Scalar

#: The name of a request or a health; which of them, its place says.
STRING_LITERAL = Scalar("string", "", "", "", 0)


class LiteralError(ValueError):
    """A literal that cannot be what its place wants; args are the message and a hint."""


def fit(value: int | float, target: Scalar) -> int | float:
    """A number as a value of `target`; a float is no integer. Raises LiteralError."""
    if target.is_integer:
        if isinstance(value, float):
            fix = "write f64(…) around what it meets, or an integer"
            if value.is_integer():
                fix = f"write {int(value)}, or f64(…) around what it meets"
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


def decimal_f32(text: str) -> float:
    """The binary32 value nearest to a decimal literal, which is rounded once: by way of f64 it could be rounded twice."""
    exact, near = Fraction(text), float(text)
    if math.isfinite(near) and Fraction(near) != exact and not _is_odd(near):
        near = math.nextafter(near, math.inf if exact > Fraction(near) else -math.inf)
    return round_f32(near)


def _is_odd(number: float) -> bool:
    """Whether the last binary digit of an f64 is 1: then it is no tie between two f32."""
    bits: int = struct.unpack("<q", struct.pack("<d", number))[0]
    return bits & 1 == 1
