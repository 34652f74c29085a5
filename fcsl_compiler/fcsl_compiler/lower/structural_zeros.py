# SPDX-License-Identifier: Apache-2.0
"""Products with a constant matrix. By definition of the language, terms with its zero elements are omitted.

The functions built here replace the library's matmul, matvec and symmetric_product if an argument is constant. They sum
the terms of the non-zero elements in the order of the library's sum. A symmetric_product with short sums is rebuilt even
without a constant argument: its rows have different lengths, and C compilers vectorise only loops of known length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from ..model import ir
from ..model.types import BOOL, Array, Type
from .product import WRITTEN_ROWS, Product, loop
from .register_blocking import by_rows

#: Library functions that omit terms with a zero of a constant argument.
PRODUCTS = frozenset({"matmul", "matvec", "symmetric_product"})

#: Products with more terms than this become loops over a table with a test for zero, because unrolled code grows with
#: the number of terms.
_UNROLLED_TERMS = 512
#: C compilers write out loops over rows of this length (emit/unrolling.py).
_SHORT_ROW = 4


@dataclass(frozen=True)
class Constant:
    """An array with known value. `name` becomes part of the names of functions specialised for it."""

    name: str
    type: Array
    values: tuple[float, ...]

    @property
    def has_zeros(self) -> bool:
        return 0.0 in self.values

    @property
    def transposed(self) -> Constant:
        rows, columns = self.type.shape
        values = tuple(self.values[i * columns + j] for j in range(columns) for i in range(rows))
        return Constant(f"{self.name}_t", replace(self.type, shape=(columns, rows)), values)


def product(f: ir.Function, name: str, known: dict[str, Constant]) -> ir.Function:
    """Specialises one of PRODUCTS at fixed sizes for these argument values. Returns f itself if there is no benefit."""
    if not known:
        return by_rows(f) or (_Product(f, known).specialised(name) if _is_short_symmetric(f) else f)
    return _Product(f, known).specialised(name) if any(c.has_zeros for c in known.values()) else f


def _is_short_symmetric(f: ir.Function) -> bool:
    return f.source_name == "symmetric_product" and isinstance(f.result, Array) and f.result.shape[0] <= WRITTEN_ROWS


class _Product(Product):
    """For a symmetric result j >= i."""

    def __init__(self, f: ir.Function, known: dict[str, Constant]):
        super().__init__(f)
        self.known = known
        #: Dimensions that the unrolled form writes out. The others are loops.
        self.by_row = self.a in known or self.is_symmetric
        self.by_column = self.b in known or self.is_vector

    def specialised(self, name: str) -> ir.Function:
        if self._terms() > _UNROLLED_TERMS:
            return self.function(name, self._by_loops(), ("total", self.scalar), ("none", BOOL))
        locals_: list[tuple[str, Type]] = [(self.row.name, self.row.type)] if self._uses_row else []
        made = self.function(name, self._unrolled(), *locals_)
        return replace(made, arguments=tuple((n, t) for n, t in self.f.arguments if n not in self.known))

    def _terms(self) -> int:
        """Number of terms in the unrolled form."""
        rows = range(self.n if self.by_row else 1)
        return sum(self._is_kept(i, p, j) for i in rows for p in range(self.k) for j in self._columns(i))

    def _columns(self, row: int) -> range:
        """The columns of a row that are written out. For a loop over columns, its first column."""
        first = row if self.is_symmetric else 0
        return range(first, self.m if self.by_column else first + 1)

    def _is_kept(self, i: int, p: int, j: int) -> bool:
        return self._value(self.a, i, p) != 0.0 and self._value(self.b, p, j) != 0.0

    def _value(self, name: str, row: int, column: int) -> float | None:
        constant = self.known.get(name)
        return None if constant is None else constant.values[row * (self.k if name == self.a else self.m) + column]

    # ---- the unrolled form: a constant's rows or columns one by one, those of what is not known in a loop -------------

    def _unrolled(self) -> tuple[ir.Stmt, ...]:
        if not self.by_row:
            i = self.variable("i", 0, self.n)
            return (loop(i, self._row(0, i)),)
        rows = tuple(s for r in range(self.n) for s in self._row(r, self.number(r)))
        return (*rows, *self.below()) if self._uses_row else rows

    @cached_property
    def _uses_row(self) -> bool:
        """Whether the rows of a symmetric result are computed in the local array, and what is below the diagonal comes
        last. It is not worth the copies without sums, nor for short rows, which are in registers anyway (measured: 4 of
        the lander's 47 ns)."""
        sums = (sum(self._is_kept(r, p, 0) for p in range(self.k)) for r in range(self.n))
        return self.is_symmetric and not self.by_column and self.m > _SHORT_ROW and max(sums) > 1

    def _row(self, r: int, row: ir.Expr) -> tuple[ir.Stmt, ...]:
        """Row r, or all rows in a loop. For a symmetric result from the diagonal on, and the column mirrored across it
        unless that comes last."""
        j = self.variable("j", r if self.is_symmetric else 0, self.m)
        if self._uses_row:
            computed = self.assign(self.in_row(j), self._sum(r, r, row, j))
            return loop(j, (computed,)), loop(j, (self.assign(self.result(row, j), self.in_row(j)),))
        body: tuple[ir.Stmt, ...] = tuple(
            self.assign(self.result(row, column), self._sum(r, s, row, column))
            for s in self._columns(r)
            for column in (self.number(s) if self.by_column else j,)
        )
        if not self.by_column:
            body = (loop(j, body),)
        if self.is_symmetric and r + 1 < self.m:
            below = self.variable("j", r + 1, self.m)
            body = (*body, loop(below, (self._mirrored(row, below),)))
        return body

    def _mirrored(self, row: ir.Expr, column: ir.Expr) -> ir.Stmt:
        return self.assign(self.result(column, row), self.result(row, column))

    def _sum(self, r: int, s: int, row: ir.Expr, column: ir.Expr) -> ir.Expr:
        """Element (r, s), (i, s) or (r, j): the sum of its terms from left to right, 0 without terms."""
        total: ir.Expr | None = None
        for p in range(self.k):
            if self._is_kept(r, p, s):
                term = self._term(r, p, s, row, column)
                total = term if total is None else self.apply("+", total, term)
        return self.real(0.0) if total is None else total

    def _term(self, r: int, p: int, s: int, row: ir.Expr, column: ir.Expr) -> ir.Expr:
        """One term. A factor 1 is omitted, a factor -1 becomes a negation."""
        known = {
            name: value
            for name, value in ((self.a, self._value(self.a, r, p)), (self.b, self._value(self.b, p, s)))
            if value is not None
        }
        left = self.real(known[self.a]) if self.a in known else self.element(self.a, row, self.number(p))
        right = self.real(known[self.b]) if self.b in known else self.element(self.b, self.number(p), column)
        if len(known) == 1:
            value, other = next(iter(known.values())), right if self.a in known else left
            if value == 1.0:
                return other
            if value == -1.0:
                return self.apply("neg", other)
        return self.apply("*", left, right)

    # ---- the compact form --------------------------------------------------------------------------------------------

    def _by_loops(self) -> tuple[ir.Stmt, ...]:
        """The same product as loops that test each element of a constant at run time."""
        i, p, j = (self.variable(v, 0, n) for v, n in (("i", self.n), ("p", self.k), ("j", self.m)))
        total, none = ir.Local(self.scalar, "total", self.span), ir.Local(BOOL, "none", self.span)
        factors = {self.a: self.element(self.a, i, p), self.b: self.element(self.b, p, j)}
        term = self.apply("*", *factors.values())
        add: tuple[ir.Stmt, ...] = (
            self.assign(total, ir.Choose(self.scalar, none, term, self.apply("+", total, term), self.span)),
            self.assign(none, ir.Const(BOOL, False, self.span)),
        )
        for name in self.known:
            add = (ir.If(self.apply("!=", factors[name], self.real(0.0)), add, (), self.span),)
        element: tuple[ir.Stmt, ...] = (
            self.assign(total, self.real(0.0)),
            self.assign(none, ir.Const(BOOL, True, self.span)),
            loop(p, add),
            self.assign(self.result(i, j), total),
        )
        if self.is_symmetric:
            return (loop(i, (loop(j, (*element, self._mirrored(i, j)), start=i),)),)
        return (loop(i, element if self.is_vector else (loop(j, element),)),)
