# SPDX-License-Identifier: Apache-2.0
"""Products with a constant matrix, as the language defines them: what a zero element would contribute is left out.

The functions made here stand in the place of the library's matmul and matvec where an argument is known: the other argument's
elements are added up for the elements that are not zero, in the order of the library's sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

from . import ir
from .ops import find
from .source import Span
from .types import BOOL, F64, I64, Array, Type

#: Library functions whose sums leave out products with a zero of a constant argument.
PRODUCTS = frozenset({"matmul", "matvec"})

#: Products with more terms than this are computed by loops over a table, with a test for zero: code grows with the terms.
_UNROLLED_TERMS = 512


@dataclass(frozen=True)
class Constant:
    """An array whose value is known. `name` is part of the names of functions that are made for it."""

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
    """matmul or matvec at fixed sizes, for these values of its arguments."""
    return _Product(f, known).function(name)


class _Product:
    """c[i, j] = Σ a[i, p] b[p, j]; in matvec there is no j."""

    def __init__(self, f: ir.Function, known: dict[str, Constant]):
        self.f, self.known, self.span = f, known, f.span
        assert isinstance(f.result, Array)
        (self.a, a_type), (self.b, b_type) = ((n, cast(Array, t)) for n, t in f.arguments)
        (self.n, self.k), self.m = a_type.shape, b_type.shape[1] if len(b_type.shape) == 2 else 1
        self.is_vector, self.types = len(b_type.shape) == 1, {self.a: a_type, self.b: b_type}
        self.result = ir.Local(f.result, "c" if "c" not in (self.a, self.b) else "result", self.span)

    def function(self, name: str) -> ir.Function:
        more: tuple[tuple[str, Type], ...] = ()
        if self._terms() <= _UNROLLED_TERMS:
            arguments = tuple((n, t) for n, t in self.f.arguments if n not in self.known)
            body = self._unrolled()
        else:
            arguments = self.f.arguments
            body, more = self._by_loops(), (("total", F64), ("none", BOOL))
        locals_ = ((self.result.name, self.result.type), *more)
        body = (*body, ir.Return(self.result, self.span))
        return replace(self.f, name=name, arguments=arguments, locals=locals_, body=body, calls=())

    def _terms(self) -> int:
        """Products in the text of the unrolled form."""
        rows, columns = range(self.n if self.a in self.known else 1), range(self.m if self.b in self.known else 1)
        return sum(self._is_kept(i, p, j) for i in rows for p in range(self.k) for j in columns)

    def _is_kept(self, i: int, p: int, j: int) -> bool:
        return self._value(self.a, i, p) != 0.0 and self._value(self.b, p, j) != 0.0

    def _value(self, name: str, row: int, column: int) -> float | None:
        constant = self.known.get(name)
        return None if constant is None else constant.values[row * (self.k if name == self.a else self.m) + column]

    # ---- the unrolled form: a constant's rows or columns one by one, those of what is not known in a loop -------------

    def _unrolled(self) -> tuple[ir.Stmt, ...]:
        rows = self.n if self.a in self.known else 0
        columns = self.m if self.b in self.known or self.is_vector else 0
        i, j = _variable("i", self.n, self.span), _variable("j", self.m, self.span)
        body: tuple[ir.Stmt, ...] = tuple(
            ir.Assign(
                self._result(self._number(r) if rows else i, self._number(s) if columns else j),
                self._sum(r, s, i, j),
                self.span,
            )
            for r in range(rows or 1)
            for s in range(columns or 1)
        )
        if not columns:
            body = (_loop(j, body),)
        return body if rows else (_loop(i, body),)

    def _sum(self, r: int, s: int, i: ir.Expr, j: ir.Expr) -> ir.Expr:
        """Element (r, s), or (i, s), (r, j): the products that are kept, from left to right; of none it is 0."""
        row = self._number(r) if self.a in self.known else i
        column = self._number(s) if self.b in self.known or self.is_vector else j
        total: ir.Expr | None = None
        for p in range(self.k):
            if self._is_kept(r, p, s):
                term = self._term(r, p, s, row, column)
                total = term if total is None else self._apply("+", total, term)
        return self._real(0.0) if total is None else total

    def _term(self, r: int, p: int, s: int, row: ir.Expr, column: ir.Expr) -> ir.Expr:
        """A product; with 1 it is the other factor itself, with -1 that negated."""
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

    # ---- the compact form --------------------------------------------------------------------------------------------

    def _by_loops(self) -> tuple[ir.Stmt, ...]:
        """The same with a test of every element of a constant when it runs."""
        i, p, j = (_variable(v, n, self.span) for v, n in (("i", self.n), ("p", self.k), ("j", self.m)))
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


def _variable(name: str, extent: int, span: Span) -> ir.RangeVar:
    return ir.RangeVar(I64, name, 0, extent - 1, span)


def _loop(variable: ir.RangeVar, body: tuple[ir.Stmt, ...]) -> ir.For:
    start, stop = ir.Const(I64, 0, variable.span), ir.Const(I64, variable.high + 1, variable.span)
    return ir.For(variable.name, start, stop, 1, body, variable.span)
