# SPDX-License-Identifier: Apache-2.0
"""Products of arrays that are too large for a function without loops (unroll.py): the same sums, row by row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from .arrays import Array, array_type

Row = Sequence[float]


def large_product(a: Array, b: Array, *, symmetric: bool) -> Array:
    """matmul, matvec or symmetric_product. Terms with the zeros of a constant are omitted; an empty sum is 0."""
    (rows, inner), columns = a.shape, b.shape[1] if len(b.shape) == 2 else 1
    right = [b.data[j::columns] for j in range(columns)]
    times = _without_zeros(bool(a.zeros), bool(b.zeros)) if a.zeros or b.zeros else _row_times(inner)
    data = list[float]()
    for i in range(rows):
        mirrored = [data[j * columns + i] for j in range(i)] if symmetric else []
        data += mirrored + times(a.data[i * inner : (i + 1) * inner], right[len(mirrored) :])
    return array_type(a.type, (rows, *b.shape[1:])).of(data)


@cache
def _row_times(inner: int) -> Callable[[Row, Sequence[Row]], list[float]]:
    """A row times each of some columns."""
    row, column = ([f"{name}{i}" for i in range(inner)] for name in "ab")
    total = " + ".join(f"{x} * {y}" for x, y in zip(row, column, strict=True))
    lines = [
        "def times(row, columns):",
        f" [{', '.join(row)}], found = row, []",
        f" for [{', '.join(column)}] in columns:",
        f"  found.append({total})",
        " return found",
    ]
    namespace: dict[str, Any] = {}
    exec("\n".join(lines), namespace)
    times: Callable[[Row, Sequence[Row]], list[float]] = namespace["times"]
    return times


def _without_zeros(left: bool, right: bool) -> Callable[[Row, Sequence[Row]], list[float]]:
    """The same, where the zeros of the row, of the columns or of both are structural."""

    def times(row: Row, columns: Sequence[Row]) -> list[float]:
        found = list[float]()
        for column in columns:
            pairs = zip(row, column, strict=True)
            terms = [x * y for x, y in pairs if not (left and x == 0.0 or right and y == 0.0)]
            found.append(_sum(terms) if terms else 0.0)
        return found

    return times


def _sum(terms: Sequence[float]) -> float:
    """From left to right. `sum` compensates from CPython 3.12 on."""
    total = terms[0]
    for term in terms[1:]:
        total += term
    return total
