# SPDX-License-Identifier: Apache-2.0
"""Products with a constant matrix. By definition of the language, terms with its zero elements are omitted.

The functions built here replace the library's matmul, matvec and symmetric_product if an argument is constant. They sum
the terms of the non-zero elements in the order of the library's sum. A symmetric_product is rebuilt even without a
constant argument: its rows have different lengths, and C compilers vectorise only loops of known length.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

from ..base.source import Span
from ..model import ir
from ..model.ops import find
from ..model.types import BOOL, F64, I64, Array, Type

#: Library functions that omit terms with a zero of a constant argument.
PRODUCTS = frozenset({"matmul", "matvec", "symmetric_product"})

#: Symmetric products with longer sums become loops: their factors would not fit in the registers. With an even number of
#: columns, pairs of elements are aligned in every row, and loops are faster for all but short sums.
_WRITTEN_SUM = 12
_WRITTEN_SUM_OF_PAIRS = 5
#: Symmetric products with more rows than this stay as they are in the library.
_WRITTEN_ROWS = 24

#: Products with more terms than this become loops over a table with a test for zero, because unrolled code grows with
#: the number of terms.
_UNROLLED_TERMS = 512


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
    made = _Product(f, known)
    return made.function(name) if made.is_better else f


class _Product:
    """c[i, j] = Σ a[i, p] b[p, j]. matvec has no j. For a symmetric result j >= i."""

    def __init__(self, f: ir.Function, known: dict[str, Constant]):
        self.f, self.known, self.span = f, known, f.span
        assert isinstance(f.result, Array)
        (self.a, a_type), (self.b, b_type) = ((n, cast(Array, t)) for n, t in f.arguments)
        (self.n, self.k), self.m = a_type.shape, b_type.shape[1] if len(b_type.shape) == 2 else 1
        self.is_vector, self.types = len(b_type.shape) == 1, {self.a: a_type, self.b: b_type}
        self.is_symmetric = f.source_name == "symmetric_product"
        #: Dimensions that the unrolled form writes out. The others are loops.
        self.by_row = self.a in known or self.is_symmetric
        self.by_column = self.b in known or self.is_vector
        self.row = ir.Local(replace(f.result, shape=(self.m,)), "row", self.span)
        self.result = ir.Local(f.result, "c" if "c" not in (self.a, self.b) else "result", self.span)

    @property
    def is_better(self) -> bool:
        if self.known:
            return any(c.has_zeros for c in self.known.values())
        return self.is_symmetric and self.n <= _WRITTEN_ROWS

    def function(self, name: str) -> ir.Function:
        more: tuple[tuple[str, Type], ...] = ()
        if not self.known and self.k > (_WRITTEN_SUM if self.m % 2 else _WRITTEN_SUM_OF_PAIRS):
            arguments = self.f.arguments
            body, more = self._by_rows(), ((self.row.name, self.row.type),)
        elif self._terms() <= _UNROLLED_TERMS:
            arguments = tuple((n, t) for n, t in self.f.arguments if n not in self.known)
            body = self._unrolled()
        else:
            arguments = self.f.arguments
            body, more = self._by_loops(), (("total", F64), ("none", BOOL))
        locals_ = ((self.result.name, self.result.type), *more)
        body = (*body, ir.Return(self.result, self.span))
        return replace(self.f, name=name, arguments=arguments, locals=locals_, body=body, calls=())

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
        if self.by_row:
            return tuple(s for r in range(self.n) for s in self._row(r, self._number(r)))
        i = _variable("i", 0, self.n, self.span)
        return (_loop(i, self._row(0, i)),)

    def _row(self, r: int, row: ir.Expr) -> tuple[ir.Stmt, ...]:
        """Row r, or all rows in a loop. For a symmetric result, also the column mirrored across the diagonal."""
        j = _variable("j", r if self.is_symmetric else 0, self.m, self.span)
        body: tuple[ir.Stmt, ...] = tuple(
            ir.Assign(self._result(row, column), self._sum(r, s, row, column), self.span)
            for s in self._columns(r)
            for column in (self._number(s) if self.by_column else j,)
        )
        if not self.by_column:
            body = (_loop(j, body),)
        if self.is_symmetric and r + 1 < self.m:
            below = _variable("j", r + 1, self.m, self.span)
            body = (*body, _loop(below, (self._mirrored(row, below),)))
        return body

    def _mirrored(self, row: ir.Expr, column: ir.Expr) -> ir.Stmt:
        return ir.Assign(self._result(column, row), self._result(row, column), self.span)

    def _sum(self, r: int, s: int, row: ir.Expr, column: ir.Expr) -> ir.Expr:
        """Element (r, s), (i, s) or (r, j): the sum of its terms from left to right, 0 without terms."""
        total: ir.Expr | None = None
        for p in range(self.k):
            if self._is_kept(r, p, s):
                term = self._term(r, p, s, row, column)
                total = term if total is None else self._apply("+", total, term)
        return self._real(0.0) if total is None else total

    def _term(self, r: int, p: int, s: int, row: ir.Expr, column: ir.Expr) -> ir.Expr:
        """One term. A factor 1 is omitted, a factor -1 becomes a negation."""
        known = {
            name: value
            for name, value in ((self.a, self._value(self.a, r, p)), (self.b, self._value(self.b, p, s)))
            if value is not None
        }
        left = self._real(known[self.a]) if self.a in known else self._element(self.a, row, self._number(p))
        right = self._real(known[self.b]) if self.b in known else self._element(self.b, self._number(p), column)
        if len(known) == 1:
            value, other = next(iter(known.values())), right if self.a in known else left
            if value == 1.0:
                return other
            if value == -1.0:
                return self._apply("neg", other)
        return self._apply("*", left, right)

    # ---- the symmetric form with long sums: rows are accumulated in a local array, which C compilers keep in registers

    def _by_rows(self) -> tuple[ir.Stmt, ...]:
        """Two rows at a time, from the diagonal on; then what is below it, row by row. Of the second row, the element
        left of the diagonal is computed in vain."""
        above = tuple(self._accumulated(r, min(r + 2, self.n)) for r in range(0, self.n, 2))
        return above + tuple(s for r in range(1, self.n) for s in self._below(r))

    def _accumulated(self, start: int, stop: int) -> ir.Stmt:
        i, j = _variable("i", start, stop, self.span), _variable("j", start, self.m, self.span)
        p, first = _variable("p", 1, self.k, self.span), self._number(0)
        total = self._at(self.row, j, first)
        product = self._apply("*", self._element(self.a, i, first), self._element(self.b, first, j))
        term = self._apply("*", self._element(self.a, i, p), self._element(self.b, p, j))
        rows = (
            _loop(j, (ir.Assign(total, product, self.span),)),
            _loop(p, (_loop(j, (ir.Assign(total, self._apply("+", total, term), self.span),)),)),
            _loop(j, (ir.Assign(self._result(i, j), total, self.span),)),
        )
        return _loop(i, rows)

    def _below(self, r: int) -> tuple[ir.Stmt, ...]:
        row, j = self._number(r), _variable("j", 0, r, self.span)
        element = self._at(self.row, j, row)
        return (
            _loop(j, (ir.Assign(element, self._result(j, row), self.span),)),
            _loop(j, (ir.Assign(self._result(row, j), element, self.span),)),
        )

    # ---- the compact form --------------------------------------------------------------------------------------------

    def _by_loops(self) -> tuple[ir.Stmt, ...]:
        """The same product as loops that test each element of a constant at run time."""
        i, p, j = (_variable(v, 0, n, self.span) for v, n in (("i", self.n), ("p", self.k), ("j", self.m)))
        total, none = ir.Local(F64, "total", self.span), ir.Local(BOOL, "none", self.span)
        factors = {self.a: self._element(self.a, i, p), self.b: self._element(self.b, p, j)}
        term = self._apply("*", *factors.values())
        add: tuple[ir.Stmt, ...] = (
            ir.Assign(total, ir.Choose(F64, none, term, self._apply("+", total, term), self.span), self.span),
            ir.Assign(none, ir.Const(BOOL, False, self.span), self.span),
        )
        for name in self.known:
            add = (ir.If(self._apply("!=", factors[name], self._real(0.0)), add, (), self.span),)
        element: tuple[ir.Stmt, ...] = (
            ir.Assign(total, self._real(0.0), self.span),
            ir.Assign(none, ir.Const(BOOL, True, self.span), self.span),
            _loop(p, add),
            ir.Assign(self._result(i, j), total, self.span),
        )
        if self.is_symmetric:
            return (_loop(i, (_loop(j, (*element, self._mirrored(i, j)), start=i),)),)
        return (_loop(i, element if self.is_vector else (_loop(j, element),)),)

    # ---- parts -------------------------------------------------------------------------------------------------------

    def _result(self, row: ir.Expr, column: ir.Expr) -> ir.Element:
        return self._at(self.result, row, column)

    def _element(self, name: str, row: ir.Expr, column: ir.Expr) -> ir.Element:
        return self._at(ir.Local(self.types[name], name, self.span), row, column)

    def _at(self, array: ir.Local, row: ir.Expr, column: ir.Expr) -> ir.Element:
        indices = (row, column) if len(cast(Array, array.type).shape) == 2 else (row,)
        return ir.Element(F64, array, indices, (False,) * len(indices), self.span)

    def _number(self, value: int) -> ir.Const:
        return ir.Const(I64, value, self.span)

    def _real(self, value: float) -> ir.Const:
        return ir.Const(F64, value, self.span)

    def _apply(self, name: str, *args: ir.Expr) -> ir.Apply:
        op = find(name, (F64,) * len(args))
        assert op is not None
        return ir.Apply(op.result, op, args, False, self.span)


def _variable(name: str, first: int, extent: int, span: Span) -> ir.RangeVar:
    return ir.RangeVar(I64, name, first, extent - 1, span)


def _loop(variable: ir.RangeVar, body: tuple[ir.Stmt, ...], start: ir.Expr | None = None) -> ir.For:
    """A loop over all values of the variable, or over those from another variable's value on."""
    first, stop = ir.Const(I64, variable.low, variable.span), ir.Const(I64, variable.high + 1, variable.span)
    return ir.For(variable.name, start or first, stop, 1, body, variable.span)
