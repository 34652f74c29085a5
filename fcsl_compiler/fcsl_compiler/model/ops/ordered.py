# SPDX-License-Identifier: Apache-2.0
"""Operations of all numbers: order, min and max as in Python, clamp, abs, sign, small powers. Also equality of other
types, and `not`."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import BOOL, HEALTH, NUMBERS, REQUEST, Scalar
from .op import Doc, Op, overflow

_GROUP = "Order and size"
_EXACT = "exact"
_MIN = Doc(
    _GROUP,
    "min(a, b)",
    "b if b < a else a",
    "exact; more arguments fold from the left",
    "a NaN in b is passed over, one in a stays; of equal operands a, so min(0.0, -0.0) is 0.0",
)
_MAX = Doc(_GROUP, "max(a, b)", "b if b > a else a", _MIN.order, "as min")
_CLAMP = Doc(
    _GROUP,
    "clamp(x, low, high)",
    "min(max(x, low), high)",
    "exact",
    "x NaN: NaN; a bound that is NaN does not bind; low above high: high",
)
_WHERE = Doc(_GROUP, "where(c, a, b)", "a where c is True, else b; both are evaluated", _EXACT, "none")
_SIGN = Doc(_GROUP, "sign(x)", "1, -1, or x itself when it is zero or NaN", _EXACT, "none")
_ABS = Doc(_GROUP, "abs(x)", "|x|", _EXACT, "the smallest integer of a signed type faults")


def operations() -> Iterator[Op]:
    for t in NUMBERS:
        for symbol in ("<", "<=", ">", ">=", "==", "!="):
            yield Op(symbol, (t, t), BOOL)
        yield from _choosing(t)
        yield from _powers(t)
    for t in (*NUMBERS, BOOL):
        yield Op("where", (BOOL, t, t), t, doc=_WHERE)
    for t in (BOOL, REQUEST, HEALTH):
        for symbol in ("==", "!="):
            yield Op(symbol, (t, t), BOOL)
    yield Op("not", (BOOL,), BOOL)


def _choosing(t: Scalar) -> Iterator[Op]:
    if t.is_float or t.is_signed:
        yield Op("abs", (t,), t, () if t.is_float else (overflow(t),), _ABS)
    for name, doc in (("min", _MIN), ("max", _MAX)):
        yield Op(name, (t, t), t, doc=doc)
    yield Op("clamp", (t, t, t), t, doc=_CLAMP)
    if t.is_float or t.is_signed:
        yield Op("sign", (t,), t, doc=_SIGN)


def _powers(t: Scalar) -> Iterator[Op]:
    """x ** 0, 2, 3, 4: repeated multiplication from the left. Signed products can fault."""
    for exponent in (0, 2, 3, 4):
        yield Op(f"**{exponent}", (t,), t, (overflow(t),) if exponent and t.is_signed else ())
