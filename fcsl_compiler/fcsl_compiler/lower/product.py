# SPDX-License-Identifier: Apache-2.0
"""What a product of matrices, or of a matrix and a vector, is rebuilt from: c[i, j] = Σ a[i, p] b[p, j]."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from ..model import ir
from ..model.ops import find
from ..model.types import I64, Array, Scalar, Type

#: The rows of a symmetric product are written out one by one. With more rows it stays as it is in the library.
WRITTEN_ROWS = 24


class Product:
    """The sizes and expressions of a product: matmul, symmetric_product, or matvec, which has no j."""

    def __init__(self, f: ir.Function):
        self.f, self.span = f, f.span
        assert isinstance(f.result, Array)
        self.scalar = cast(Scalar, f.result.element)
        (self.a, a_type), (self.b, b_type) = ((n, cast(Array, t)) for n, t in f.arguments)
        (self.n, self.k), self.m = a_type.shape, b_type.shape[1] if len(b_type.shape) == 2 else 1
        self.is_vector, self.types = len(b_type.shape) == 1, {self.a: a_type, self.b: b_type}
        self.is_symmetric = f.source_name == "symmetric_product"
        self.c = ir.Local(f.result, "c" if "c" not in (self.a, self.b) else "result", self.span)
        #: A row is computed in this local array. Neither argument can be that array, so C compilers keep its elements in
        #: registers, and need no second version of a loop for that case.
        self.row = ir.Local(replace(f.result, shape=(self.m,)), "row", self.span)

    def result(self, row: ir.Expr, column: ir.Expr) -> ir.Element:
        return self._at(self.c, row, column)

    def in_row(self, column: ir.Expr) -> ir.Element:
        return self._at(self.row, column, column)

    def element(self, name: str, row: ir.Expr, column: ir.Expr) -> ir.Element:
        return self._at(ir.Local(self.types[name], name, self.span), row, column)

    def _at(self, array: ir.Local, row: ir.Expr, column: ir.Expr) -> ir.Element:
        indices = (row, column) if len(cast(Array, array.type).shape) == 2 else (row,)
        return ir.Element(self.scalar, array, indices, (False,) * len(indices), self.span)

    def number(self, value: int) -> ir.Const:
        return ir.Const(I64, value, self.span)

    def real(self, value: float) -> ir.Const:
        return ir.Const(self.scalar, value, self.span)

    def after(self, index: ir.Expr, distance: int) -> ir.Expr:
        """The index so many elements further on."""
        return self._operation(I64, "+", index, self.number(distance)) if distance else index

    def apply(self, name: str, *args: ir.Expr) -> ir.Apply:
        return self._operation(self.scalar, name, *args)

    def _operation(self, type_: Scalar, name: str, *args: ir.Expr) -> ir.Apply:
        op = find(name, (type_,) * len(args))
        assert op is not None
        return ir.Apply(op.result, op, args, False, self.span)

    def assign(self, target: ir.Place, value: ir.Expr) -> ir.Assign:
        return ir.Assign(target, value, self.span)

    def below(self) -> tuple[ir.Stmt, ...]:
        """Row by row, what is below the diagonal of a symmetric result, from what is above it."""
        made: list[ir.Stmt] = []
        for r in range(1, self.n):
            row, j = self.number(r), self.variable("j", 0, r)
            made.append(loop(j, (self.assign(self.in_row(j), self.result(j, row)),)))
            made.append(loop(j, (self.assign(self.result(row, j), self.in_row(j)),)))
        return tuple(made)

    def variable(self, name: str, first: int, extent: int) -> ir.RangeVar:
        return ir.RangeVar(I64, name, first, extent - 1, self.span)

    def function(self, name: str, body: tuple[ir.Stmt, ...], *locals_: tuple[str, Type]) -> ir.Function:
        """The function with this body, which returns the result."""
        variables = ((self.c.name, self.c.type), *locals_)
        return replace(self.f, name=name, locals=variables, body=(*body, ir.Return(self.c, self.span)), calls=())


def loop(variable: ir.RangeVar, body: tuple[ir.Stmt, ...], start: ir.Expr | None = None) -> ir.For:
    """A loop over all values of the variable, or over those from another variable's value on."""
    first, stop = ir.Const(I64, variable.low, variable.span), ir.Const(I64, variable.high + 1, variable.span)
    return ir.For(variable.name, start or first, stop, 1, body, variable.span)
