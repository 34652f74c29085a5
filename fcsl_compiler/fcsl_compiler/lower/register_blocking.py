# SPDX-License-Identifier: Apache-2.0
"""Register blocking: products whose rows are accumulated in registers, those with long rows and symmetric ones with long
sums.

The library's matmul keeps a row in a local array, whose elements C compilers put in registers if they are few. A longer
row is computed in parts. The rows of a symmetric_product have different lengths, and C compilers vectorise only loops of
known length, so its rows are loops of their own. Every element is the library's sum.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..model import ir
from .product import WRITTEN_ROWS, Product, loop

#: gcc 12 keeps the sums of so many columns in registers (measured: with 16, matmul takes more than four times as long).
_LONGEST_PART = 15
#: Symmetric products with shorter sums are written out (structural_zeros.py): their factors fit in the registers. With an
#: even number of columns, pairs of elements are aligned in every row, and loops are faster for all but short sums.
_SHORT_SUM = 9
_SHORT_SUM_OF_PAIRS = 5


def by_rows(f: ir.Function) -> ir.Function | None:
    """A product at fixed sizes with its rows in registers. None if there is no benefit."""
    p = Product(f)
    if p.is_symmetric:
        short = p.k <= (_SHORT_SUM if p.m % 2 else _SHORT_SUM_OF_PAIRS)
        body = None if short or p.n > WRITTEN_ROWS else (*_upper_rows(p), *p.below())
    else:
        body = None if p.is_vector or p.m <= _LONGEST_PART else (_rows(p, range(p.n), 0),)
    return None if body is None else p.function(f.name, body, (p.row.name, p.row.type))


def _upper_rows(p: Product) -> Iterator[ir.Stmt]:
    """Two rows at a time, from the diagonal on. Of the second row, the element left of the diagonal is computed in vain."""
    for r in range(0, p.n, 2):
        yield _rows(p, range(r, min(r + 2, p.n)), r)


def _rows(p: Product, rows: range, first: int) -> ir.Stmt:
    """These rows, from column `first` on."""
    i = p.variable("i", rows.start, rows.stop)
    return loop(i, tuple(s for columns in _parts(first, p.m) for s in _part(p, i, columns)))


def _part(p: Product, i: ir.RangeVar, columns: range) -> tuple[ir.Stmt, ...]:
    j, q, first = p.variable("j", 0, len(columns)), p.variable("p", 1, p.k), p.number(0)
    total, column = p.in_row(j), p.after(j, columns.start)
    product = p.apply("*", p.element(p.a, i, first), p.element(p.b, first, column))
    term = p.apply("*", p.element(p.a, i, q), p.element(p.b, q, column))
    return (
        loop(j, (p.assign(total, product),)),
        loop(q, (loop(j, (p.assign(total, p.apply("+", total, term)),)),)),
        loop(j, (p.assign(p.result(i, column), total),)),
    )


def _parts(start: int, stop: int) -> Iterator[range]:
    """The columns in as few parts as possible, of even widths where possible: pairs of elements stay together."""
    for parts in range(-(-(stop - start) // _LONGEST_PART), 0, -1):
        width = -(-(stop - start) // parts)
        width += width % 2 if parts > 1 and width < _LONGEST_PART else 0
        yield range(start, start + width)
        start += width
