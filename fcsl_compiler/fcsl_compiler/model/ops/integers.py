# SPDX-License-Identifier: Apache-2.0
"""Operations of i32, i64, u32 and u64: checked, wrapping and saturating arithmetic, division, shifts, bits."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import INTEGERS, Scalar
from .op import Doc, Op, overflow

_GROUP = "Integer arithmetic without faults"
_ARITHMETIC = (("+", "add"), ("-", "sub"), ("*", "mul"))
_ZERO_DIVISOR = "the divisor is zero"


def operations() -> Iterator[Op]:
    for t in INTEGERS:
        yield from _signed(t) if t.is_signed else _unsigned(t)
        yield from _bits(t)
    for symbol, word in _ARITHMETIC:
        for t in INTEGERS:
            yield _wrapping(symbol, word, t)
    for symbol, word in _ARITHMETIC:
        for t in INTEGERS:
            yield _saturating(symbol, word, t)


def _signed(t: Scalar) -> Iterator[Op]:
    for symbol, _ in _ARITHMETIC:
        yield Op(symbol, (t, t), t, (overflow(t),))
    yield Op("neg", (t,), t, (overflow(t),))
    # Floor division, as in Python. MIN % -1 is 0.
    yield Op("//", (t, t), t, (_ZERO_DIVISOR, overflow(t)))
    yield Op("%", (t, t), t, (_ZERO_DIVISOR,))


def _unsigned(t: Scalar) -> Iterator[Op]:
    for symbol, _ in _ARITHMETIC:
        yield Op(symbol, (t, t), t)
    yield Op("neg", (t,), t)
    for symbol in ("//", "%"):
        yield Op(symbol, (t, t), t, (_ZERO_DIVISOR,))


def _bits(t: Scalar) -> Iterator[Op]:
    for symbol in "&|^":
        yield Op(symbol, (t, t), t)
    yield Op("~", (t,), t)
    # A right shift rounds down, as in Python.
    for symbol in (">>",) if t.is_signed else ("<<", ">>"):
        for count in INTEGERS:
            yield Op(symbol, (t, count), t, (f"the shift count is outside [0, {t.size * 8})",))


def _wrapping(symbol: str, word: str, t: Scalar) -> Op:
    name = f"wrap_{word}"
    doc = Doc(
        _GROUP,
        f"{name}(a, b)",
        f"a {symbol} b modulo 2^n, n the width of the type",
        "exact: the lowest n bits stay",
        "none",
    )
    return Op(name, (t, t), t, doc=doc)


def _saturating(symbol: str, word: str, t: Scalar) -> Op:
    name = f"sat_{word}"
    doc = Doc(
        _GROUP, f"{name}(a, b)", f"a {symbol} b, or the end of the type's range that it is beyond", "exact", "none"
    )
    return Op(name, (t, t), t, doc=doc)
