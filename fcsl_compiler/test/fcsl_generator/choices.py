# SPDX-License-Identifier: Apache-2.0
"""Choices of the generator, made by Hypothesis. Every choice shrinks to its first, smallest or negative option."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, TypeVar

import numpy as np
from hypothesis import strategies as st

from .types import FLOATS, HEALTH, HEALTH_NAMES, RANGE, REQUEST, REQUESTS, Array, Struct, Type, row

T = TypeVar("T")


@cache
def _upto(high: int) -> st.SearchStrategy[int]:
    return st.integers(0, high)


_ANY_F64 = st.floats(allow_subnormal=True)
_ANY_F32 = st.floats(width=32)
_PLAIN = (0.0, 1.0, 0.5, 2.0, -1.0, -0.5, 3.0, 0.1, 10.0, -2.75, 100.0, 1e-3, -7.25, 0.30000000000000004)
_ODD = (-0.0, math.inf, -math.inf, math.nan, 1e308, -1e-308, 5e-324, 2147483647.0, 2147483648.0, -9.3e18, 1.5e19, 1e38)
_ODD_F32 = (
    -0.0,
    math.inf,
    -math.inf,
    math.nan,
    3.4028235e38,
    1e-45,
    2147483648.0,
    -9.223372e18,
    1.8446744e19,
    16777217.0,
)


class Choices:
    def __init__(self, draw: Callable[[st.SearchStrategy[Any]], Any]):
        self._draw = draw
        #: Names that a JSON or a host may use.
        self.requests: tuple[str, ...] = REQUESTS

    def upto(self, high: int) -> int:
        return int(self._draw(_upto(high))) if high > 0 else 0

    def between(self, low: int, high: int) -> int:
        return low + self.upto(high - low)

    def pick(self, options: Sequence[T]) -> T:
        return options[self.upto(len(options) - 1)]

    def chance(self, percent: int) -> bool:
        return self.upto(99) >= 100 - percent

    def weighted(self, options: Sequence[tuple[int, T]]) -> T:
        at = self.upto(sum(w for w, _ in options) - 1)
        for weight, option in options:
            if at < weight:
                return option
            at -= weight
        raise AssertionError

    def some(self, options: Sequence[T], percent: int = 50) -> list[T]:
        return [o for o in options if self.chance(percent)]

    # ---- values ----------------------------------------------------------------------------------------------------

    def number(self, type_: str, odd: int = 20) -> int | float:
        """A value of a number type: mostly small, in `odd` percent of the cases any value."""
        if type_ in FLOATS:
            if not self.chance(odd):
                return single(self.pick(_PLAIN)) if type_ == "f32" else self.pick(_PLAIN)
            if self.chance(50):
                return single(self.pick(_ODD_F32)) if type_ == "f32" else self.pick(_ODD)
            return float(self._draw(_ANY_F32 if type_ == "f32" else _ANY_F64))
        low, high = RANGE[type_]
        if not self.chance(odd if low == 0 else odd // 2):  # most sums of signed values overflow
            small = self.upto(9)
            return -small if low and self.chance(30) else small
        edge = self.pick((high, low, high - 1, low + 1, 255, 65536, high // 2 + 1, high // 3))
        return edge if self.chance(60) else self.between(low, high)

    def value(self, type_: Type, odd: int = 20) -> Any:
        """A value in the form of a JSON literal. Floats may be NaN and infinite."""
        if isinstance(type_, Array):
            return [self.value(row(type_), odd) for _ in range(type_.shape[0])]
        if isinstance(type_, Struct):
            return {name: self.value(member, odd) for name, member in type_.members}
        if type_ == "bool":
            return self.chance(50)
        if type_ == REQUEST:
            return self.pick(("", *self.requests))
        return self.pick(HEALTH_NAMES) if type_ == HEALTH else self.number(type_, odd)

    def literal(self, type_: Type) -> Any:
        """A value that JSON can represent: finite."""
        return _finite(self.value(type_, 10))

    def sparse(self, value: Any) -> Any:
        """An array of floats with many elements 0, -0, 1 and -1, which a compiler may treat specially."""
        if isinstance(value, list):
            return [self.sparse(v) for v in value]
        return self.weighted(((5, 0.0), (1, -0.0), (2, 1.0), (1, -1.0), (3, value)))


def single(x: float) -> float:
    """The nearest binary32 value."""
    with np.errstate(all="ignore"):
        return float(np.float32(x))


def _finite(value: Any) -> Any:
    if isinstance(value, list):
        return [_finite(v) for v in value]
    if isinstance(value, dict):
        return {n: _finite(v) for n, v in value.items()}
    return 0.25 if isinstance(value, float) and not math.isfinite(value) else value
