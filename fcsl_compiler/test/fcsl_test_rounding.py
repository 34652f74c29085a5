# SPDX-License-Identifier: Apache-2.0
"""Is a result the exact value rounded once? mpmath decides, after the processor's long double has passed the clear cases."""

from __future__ import annotations

import math
from collections.abc import Callable

import mpmath
import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

_REFERENCE = {
    "log2": lambda x: mpmath.log(x) / mpmath.log(2),
    "cbrt": lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)),
    "pow": mpmath.power,
}
_NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "power"}

#: glibc's long double functions are within 5 units of their last place (its manual, "Known Maximum Errors in Math
#: Functions"), less than 2^-60 of the value; four times that much is allowed before mpmath is asked.
_LONG_DOUBLE_ERROR = 2.0**-58
#: Where one precision leaves a result in doubt the next is tried; what even the last cannot tell from a tie is one: atan2 of
#: the smallest quotients lies 2^-2148 of its value beside it.
_PRECISIONS = (140, 400, 2400)
_MPMATH_ERROR_BITS = 16  # of its last bits, mpmath promises fewer to be wrong


def _reference(name: str) -> Callable[..., mpmath.mpf]:
    return _REFERENCE.get(name) or getattr(mpmath, name)


def misrounded(name: str, arguments: tuple[Doubles, ...], results: Doubles, *, single: bool, screen: bool) -> list[int]:
    """Positions where `results` is not the correctly rounded value. With `screen` mpmath is asked only in doubt."""
    value = _long_double(name, arguments)
    passed = _same_special(value, results)
    # mpmath has no signed zeros, and no functions of infinities and NaN.
    numbers = np.all([np.isfinite(a) & (a != 0) for a in arguments], axis=0)
    if screen or not numbers.all():
        passed |= _clearly_right(value, results, single) & (screen | ~numbers)
    doubtful = np.flatnonzero(~passed)
    return [int(i) for i in doubtful if not _is_rounded(name, [a[i] for a in arguments], results[i], single)]


def _long_double(name: str, arguments: tuple[Doubles, ...]) -> NDArray[np.longdouble]:
    with np.errstate(all="ignore"):
        f = getattr(np, _NUMPY.get(name, name))
        value: NDArray[np.longdouble] = f(*(a.astype(np.longdouble) for a in arguments))
        return value


def _same_special(value: NDArray[np.longdouble], results: Doubles) -> NDArray[np.bool_]:
    """NaNs, and infinities and zeros of one sign, which C's standard fixes or which 15 bits of exponent have not avoided."""
    special = (np.isinf(value) & np.isinf(results)) | ((value == 0) & (results == 0))
    same: NDArray[np.bool_] = special & (np.signbit(value) == np.signbit(results)) | (
        np.isnan(value) & np.isnan(results)
    )
    return same


def _clearly_right(value: NDArray[np.longdouble], results: Doubles, single: bool) -> NDArray[np.bool_]:
    """Where the value lies between the middles to both neighbours of the result, by more than long double can err."""
    if np.finfo(np.longdouble).nmant < 63:
        return np.zeros(results.shape, bool)
    with np.errstate(all="ignore"):
        rounded = results.astype(np.float32 if single else np.float64)
        below, above = (np.nextafter(rounded, rounded.dtype.type(s * np.inf)).astype(np.longdouble) for s in (-1, 1))
        exact = rounded.astype(np.longdouble)
        beyond = np.longdouble(2) ** (128 if single else 1024)  # in the place of an infinity
        below, exact, above = (np.clip(v, -beyond, beyond) for v in (below, exact, above))
        error = np.abs(value) * np.longdouble(_LONG_DOUBLE_ERROR)
        low, high = (below + exact) / 2, (exact + above) / 2
        high = np.where(rounded == np.inf, np.longdouble(np.inf), high)
        low = np.where(rounded == -np.inf, -np.longdouble(np.inf), low)
        inside: NDArray[np.bool_] = (
            (value - error > low) & (value + error < high) & (np.signbit(value) == np.signbit(results))
        )
    return inside


def _is_rounded(name: str, arguments: list[float], result: float, single: bool) -> bool:
    if not all(map(math.isfinite, arguments)) or math.isnan(result):
        return False  # nothing to compute: long double has said what the standard wants
    for precision in _PRECISIONS:
        with mpmath.workprec(precision):
            value = _reference(name)(*map(mpmath.mpf, map(float, arguments)))
        if not isinstance(value, mpmath.mpf):
            return False  # complex: outside of the domain
        if value == 0:
            return False  # long double has said which zero
        nearest = _nearest(value, precision, single)
        if nearest is not None:
            return nearest == result and math.copysign(1.0, nearest) == math.copysign(1.0, result)
    raise AssertionError("the last precision always decides")


def _nearest(value: mpmath.mpf, precision: int, single: bool) -> float | None:
    """The value rounded to nearest even; None where its own error leaves that open."""
    sign, mantissa, exponent, size = value._mpf_
    mantissa, exponent = mantissa << (precision - size), exponent - (precision - size)
    digits, least, beyond = (24, -149, 128) if single else (53, -1074, 1024)
    if not least - 1 <= exponent + precision <= beyond + 1:  # far from every number
        return math.copysign(math.inf if exponent + precision > 0 else 0.0, -sign or 1)
    unit = max(exponent + precision - digits, least)
    shift = unit - exponent
    kept, rest, half = mantissa >> shift, mantissa & ((1 << shift) - 1), 1 << (shift - 1)
    tie = abs(rest - half) <= 1 << _MPMATH_ERROR_BITS
    if tie and precision != _PRECISIONS[-1]:
        return None
    kept += kept & 1 if tie else rest > half
    number = math.inf if kept and kept.bit_length() + unit > beyond else math.ldexp(float(kept), unit)
    return -number if sign else number
