# SPDX-License-Identifier: Apache-2.0
"""Arithmetic of expressions on columns: the values at all ticks of a flight, and what is of all ticks. As IEEE 754 has it, division
by zero gives an infinity or NaN. Integers have 64 bits, floating numbers are doubles. An integer that does not fit is an
ExpressionError.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from fcsl_compiler.api.expressions import Arithmetic, ExpressionError

Array = np.ndarray[Any, Any]


def widest(values: Array) -> Array:
    """Numbers as 64 bits have them; bools and names as they are."""
    kind = values.dtype.kind
    if kind == "u":
        _check_fits(values)
    return values.astype(np.float64 if kind == "f" else np.int64) if kind in "fiu" else values


def _number(value: Any) -> Any:
    """A bool counts as 1 or 0."""
    array = np.asarray(value)
    return array.astype(np.int64) if array.dtype.kind == "b" else array


def _real(value: Any) -> Array:
    return np.asarray(value, np.float64)


def _check_fits(values: Any) -> None:
    if np.any(np.abs(values) >= 2.0**63):
        raise ExpressionError("an integer does not fit 64 bits")


def _of_integers(function: Callable[..., Any]) -> Callable[..., Any]:
    """Numbers, of which integers must fit."""

    def apply(*values: Any) -> Any:
        numbers = [_number(value) for value in values]
        if all(number.dtype.kind == "i" for number in numbers):
            _check_fits(function(*map(_real, numbers)))
        return function(*numbers)

    return apply


def _of_numbers(function: Callable[..., Any], convert: Callable[[Any], Any] = _number) -> Callable[..., Any]:
    return lambda *values: function(*map(convert, values))


def _smaller(a: Array, b: Array) -> Array:
    """As Python's min, which keeps the first where the second is NaN."""
    return np.where(b < a, b, a)


def _greater(a: Array, b: Array) -> Array:
    return np.where(b > a, b, a)


def _folded(join: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    return lambda *values: functools.reduce(join, map(_number, values))


#: Of each tick by itself.
_AT_A_TICK: dict[str, Callable[..., Any]] = {
    **{"+": _of_integers(np.add), "-": _of_integers(np.subtract), "*": _of_integers(np.multiply)},
    **{"/": _of_numbers(np.divide), "**": _of_numbers(np.float_power)},
    **{"//": _of_numbers(np.floor_divide, _real), "%": _of_numbers(np.remainder, _real)},
    **{"negative": _of_integers(np.negative), "positive": _number, "abs": _of_integers(np.abs)},
    **{"sqrt": _of_numbers(np.sqrt, _real), "degrees": _of_numbers(np.degrees, _real)},
    **{"isnan": _of_numbers(np.isnan, _real), "isfinite": _of_numbers(np.isfinite, _real)},
    "norm": lambda x: np.sqrt(np.square(_real(x)).sum(axis=-1)),
    "and": lambda *values: functools.reduce(np.logical_and, values),
    "or": lambda *values: functools.reduce(np.logical_or, values),
    "not": np.logical_not,
}
#: Of all ticks.
_OF_ALL: dict[str, Callable[[Array], Any]] = {
    "first": lambda x: x[0],
    "last": lambda x: x[-1],
    "mean": lambda x: _number(x).mean(axis=0),
    "std": lambda x: _number(x).std(axis=0),
    "rms": lambda x: np.sqrt(np.square(_real(x)).mean(axis=0)),
    "any": np.any,
    "all": np.all,
}
_SMALLER, _GREATER = _folded(_smaller), _folded(_greater)


def column_arithmetic(tick_hz: float) -> Arithmetic:
    dt = 1.0 / tick_hz
    of_all: dict[str, Callable[..., Any]] = {
        **_OF_ALL,
        "min": lambda *x: _SMALLER(*x) if len(x) > 1 else _number(x[0]).min(axis=0),
        "max": lambda *x: _GREATER(*x) if len(x) > 1 else _number(x[0]).max(axis=0),
        "time": lambda x: float(np.argmax(x)) * dt if np.any(x) else np.nan,
        "duration": lambda x: float(np.count_nonzero(x)) * dt,
    }
    return Arithmetic(_AT_A_TICK | of_all, lazy=False, widen=_widened)


def _widened(value: Any) -> Any:
    """A column of scalars beside one of vectors."""
    array = np.asarray(value)
    return array[..., np.newaxis] if array.ndim else array
