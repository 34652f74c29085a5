# SPDX-License-Identifier: Apache-2.0
"""Values that are to be close: what differs most is shown as a table, with path, tick and unit.

A number is close when |actual - expected| <= atol + rtol * |expected|; what is no number must be equal. Infinities are close to
themselves, NaN to NaN when `equal_nan` says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

#: Elements that a failure shows.
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
    """Raises AssertionError when `actual` is not close to `expected`, of the same shape or to be broadcast to it.

    Both are numbers, texts, bools, (nested lists of) such or NumPy arrays of them, or dicts and structured arrays, member by
    member; masked elements of `expected` are passed over. `label` and `units` (by path) name what is shown; with `ticks` the first axis is time; `place` says where the
    machine is.
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
    """One element that is off, by `difference`, where `allowed` is."""

    def __init__(self, path: str, index: tuple[int, ...], pair: tuple[Any, Any], difference: float, allowed: float):
        self.path, self.index, self.difference, self.allowed = path, index, difference, allowed
        self.actual, self.expected = pair

    @property
    def badness(self) -> float:
        """How many times what is allowed."""
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
        bad = ~((difference <= allowed) | (one == other))  # without a relative tolerance, of an infinity NaN is allowed
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
    """Of what is no struct, or not as many of them."""
    array = np.asarray(value, dtype=object)
    return f"an array of {' × '.join(map(str, array.shape))}" if array.ndim else repr(value)


def _shown(value: Any) -> str:
    return repr(value.item() if hasattr(value, "item") else value)
