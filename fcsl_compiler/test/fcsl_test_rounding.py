# SPDX-License-Identifier: Apache-2.0
"""Checks whether a result is correctly rounded. The processor's long double decides clear cases, mpmath the others."""

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

#: glibc's long double functions are within 5 units of the last place (its manual, "Known Maximum Errors in Math
#: Functions"), less than 2^-60 of the value. Four times this error is assumed; closer cases are passed to mpmath.
_LONG_DOUBLE_ERROR = 2.0**-58
#: Precisions in bits, tried in turn until the result is certain. A result that the last cannot distinguish from a tie
#: is one: atan2 of the smallest quotients differs from a tie by 2^-2148 of its value.
_PRECISIONS = (140, 400, 2400)
_MPMATH_ERROR_BITS = 16  # of its last bits; mpmath promises fewer to be wrong


def _reference(name: str) -> Callable[..., mpmath.mpf]:
    return _REFERENCE.get(name) or getattr(mpmath, name)


def misrounded(name: str, arguments: tuple[Doubles, ...], results: Doubles, *, single: bool, screen: bool) -> list[int]:
    """Positions where `results` is not the correctly rounded value. With `screen`, mpmath is used only in doubt."""
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
    """Equal NaNs, infinities or zeros with signs. The C standard defines them, or the 15-bit exponent cannot avoid
    them."""
    special = (np.isinf(value) & np.isinf(results)) | ((value == 0) & (results == 0))
    same: NDArray[np.bool_] = special & (np.signbit(value) == np.signbit(results)) | (
        np.isnan(value) & np.isnan(results)
    )
    return same


def _clearly_right(value: NDArray[np.longdouble], results: Doubles, single: bool) -> NDArray[np.bool_]:
    """True if the distance of the value from the midpoints to both neighbours of the result exceeds the error of long
    double."""
    if np.finfo(np.longdouble).nmant < 63:
        return np.zeros(results.shape, bool)
    with np.errstate(all="ignore"):
        rounded = results.astype(np.float32 if single else np.float64)
        below, above = (np.nextafter(rounded, rounded.dtype.type(s * np.inf)).astype(np.longdouble) for s in (-1, 1))
        exact = rounded.astype(np.longdouble)
        beyond = np.longdouble(2) ** (128 if single else 1024)  # represents infinity
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
        return False  # nothing to compute: long double gave the value of the standard
    for precision in _PRECISIONS:
        with mpmath.workprec(precision):
            value = _reference(name)(*map(mpmath.mpf, map(float, arguments)))
        if not isinstance(value, mpmath.mpf):
            return False  # complex: outside of the domain
        if value == 0:
            return False  # long double gave the sign of the zero
        nearest = _nearest(value, precision, single)
        if nearest is not None:
            return nearest == result and math.copysign(1.0, nearest) == math.copysign(1.0, result)
    raise AssertionError("the last precision always decides")


def _nearest(value: mpmath.mpf, precision: int, single: bool) -> float | None:
    """The value rounded to nearest even. None if its error leaves this open."""
    sign, mantissa, exponent, size = value._mpf_
    mantissa, exponent = mantissa << (precision - size), exponent - (precision - size)
    digits, least, beyond = (24, -149, 128) if single else (53, -1074, 1024)
    if not least - 1 <= exponent + precision <= beyond + 1:  # far outside the range of the type
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
