# SPDX-License-Identifier: Apache-2.0
"""Compares values within tolerances; a failure lists the largest differences in a table with path, tick and unit.

A number is close when |actual - expected| <= atol + rtol * |expected|; other values must be equal. Infinities are close
to themselves; NaN is close to NaN with `equal_nan`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

#: Most elements in a failure message.
_SHOWN = 10


def assert_close(
    actual: Any,
    expected: Any,
    rtol: float = 1e-9,
    atol: float = 0.0,
    equal_nan: bool = False,
    *,
    label: str = "value",
    units: Mapping[str, str] | None = None,
    ticks: Array | None = None,
    place: str = "",
) -> None:
    """Raises AssertionError unless `actual` is close to `expected`, whose shape is the same or broadcasts to it.

    Both are numbers, texts or bools, (nested) lists or NumPy arrays of them, or dicts and structured arrays, which are
    compared by member. Masked elements of `expected` are skipped. `label` and `units` (by path) appear in the message.
    With `ticks` the first axis is time. `place` describes the machine's current tick and state.
    """
    __tracebackhide__ = True
    rows: list[_Row] = []
    total = 0
    for path, one, other in _pairs(label, actual, expected, ticks is not None):
        found = _compare(path, one, other, rtol, atol, equal_nan)
        rows += found
        total += one.size
    if rows:
        raise AssertionError(_message(label, rows, total, (rtol, atol), units or {}, ticks, place))


class _Row:
    """One element that is not close: its `difference` and the `allowed` one."""

    def __init__(self, path: str, index: tuple[int, ...], pair: tuple[Any, Any], difference: float, allowed: float):
        self.path, self.index, self.difference, self.allowed = path, index, difference, allowed
        self.actual, self.expected = pair

    @property
    def badness(self) -> float:
        """Ratio of the difference to the allowed one."""
        if not np.isfinite(self.difference):
            return np.inf
        return self.difference / self.allowed if self.allowed else np.inf


def _pairs(label: str, actual: Any, expected: Any, timed: bool) -> list[tuple[str, Array, Array]]:
    """(path, actual, expected) of every leaf."""
    if isinstance(actual, Mapping) or getattr(getattr(actual, "dtype", None), "names", None):
        names = list(actual) if isinstance(actual, Mapping) else list(actual.dtype.names)
        given = (
            list(expected)
            if isinstance(expected, Mapping)
            else getattr(getattr(expected, "dtype", None), "names", None)
        )
        if given is None:
            raise AssertionError(f"{label}: a struct of {', '.join(names)}, expected {_brief(expected)}")
        if set(names) != set(given):
            raise AssertionError(f"{label}: members {', '.join(names)}, expected {', '.join(given)}")
        return [pair for n in names for pair in _pairs(f"{label}.{n}", actual[n], expected[n], timed)]
    if isinstance(actual, list) and actual and isinstance(actual[0], Mapping):
        if not isinstance(expected, list | tuple | np.ndarray) or len(actual) != len(expected):
            raise AssertionError(f"{label}: {len(actual)} structs, expected {_brief(expected)}")
        both = enumerate(zip(actual, expected, strict=True))
        return [pair for i, (a, e) in both for pair in _pairs(f"{label}[{i}]", a, e, timed)]
    one, other = np.asarray(actual), np.ma.asarray(expected)
    if timed and other.ndim and other.ndim == one.ndim and len(other) != len(one):
        raise AssertionError(f"{label}: {len(one)} ticks, {len(other)} expected")
    try:
        data, mask = (np.broadcast_to(part, one.shape) for part in (other.data, np.ma.getmaskarray(other)))
        return [(label, one, np.ma.MaskedArray(data, mask))]
    except ValueError:
        raise AssertionError(f"{label}: shape {one.shape}, expected {other.shape}") from None


def _compare(path: str, actual: Array, expected: Array, rtol: float, atol: float, equal_nan: bool) -> list[_Row]:
    numbers, masked, expected = "iuf", np.ma.getmaskarray(expected), np.ma.getdata(expected)
    if actual.dtype.kind not in numbers or expected.dtype.kind not in numbers:
        differ = (actual != expected) & ~masked
        return [_Row(path, tuple(i), (actual[tuple(i)], expected[tuple(i)]), np.inf, 0.0) for i in np.argwhere(differ)]
    with np.errstate(invalid="ignore", over="ignore"):
        one, other = actual.astype(np.longdouble), expected.astype(np.longdouble)
        difference = np.where(one == other, 0, np.abs(one - other))
        allowed = atol + rtol * np.abs(other)
        bad = ~((difference <= allowed) | (one == other))  # with rtol = 0 the allowed difference to an infinity is NaN
        bad |= (np.isinf(one) | np.isinf(other)) & (one != other)
    if equal_nan:
        bad &= ~(np.isnan(one) & np.isnan(other))
    bad &= ~masked
    places = [tuple(int(i) for i in place) for place in np.argwhere(bad)]
    return [_Row(path, p, (actual[p], expected[p]), float(difference[p]), float(allowed[p])) for p in places]


def _message(
    label: str,
    rows: list[_Row],
    total: int,
    tolerances: tuple[float, float],
    units: Mapping[str, str],
    ticks: Array | None,
    place: str,
) -> str:
    rows.sort(key=lambda row: (-row.badness, row.path, row.index))
    head = f"{label}: {len(rows)} of {total} values are not close (rtol {tolerances[0]:g}, atol {tolerances[1]:g})"
    lines = [head + (f", {place}" if place else "")]
    table = [("tick",) * (ticks is not None) + ("value", "actual", "expected", "difference", "allowed", "unit")]
    for row in rows[:_SHOWN]:
        index = row.index[1:] if ticks is not None else row.index
        when = (str(ticks[row.index[0]]),) if ticks is not None else ()
        path = row.path + "".join(f"[{i}]" for i in index)
        numbers = (f"{row.difference:.6g}", f"{row.allowed:.6g}") if np.isfinite(row.difference) else ("", "")
        table.append((*when, path, _shown(row.actual), _shown(row.expected), *numbers, units.get(row.path, "")))
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    lines += ["  " + "  ".join(f"{cell:<{w}}" for cell, w in zip(line, widths, strict=True)).rstrip() for line in table]
    if len(rows) > _SHOWN:
        lines.append(f"  … and {len(rows) - _SHOWN} more")
    return "\n".join(lines)


def _brief(value: Any) -> str:
    """Short text of a value that is not the expected struct or array of structs."""
    array = np.asarray(value, dtype=object)
    return f"an array of {' × '.join(map(str, array.shape))}" if array.ndim else repr(value)


def _shown(value: Any) -> str:
    return repr(value.item() if hasattr(value, "item") else value)
