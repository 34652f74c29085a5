# SPDX-License-Identifier: Apache-2.0
"""Gives calls that reach outside the machine (externs, hardware) their order in time: moves them out of expressions. Each
becomes a statement that stores its result in a hidden local.

Python evaluates from left to right. Operands to the left of such a call that may fault are therefore computed before
it: their fault prevents the call, and a fault to its right does not. Arguments that may fault are computed before the
call for the same reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..base.source import Span
from ..model import ir
from ..model.effects import can_fault
from ..model.types import I64, Array, Scalar, Type
from .scope import Scope


def reaches_outside(e: ir.Expr) -> bool:
    """Whether an expression contains a call that reaches outside the machine."""
    return isinstance(e, ir.EffectCall) or any(map(reaches_outside, ir.children(e)))


class Hoister:
    """Hoists calls in the statements of one function. Hidden locals get names that are not valid Python."""

    def __init__(self, scope: Scope):
        self.scope = scope
        self._count = 0

    def statements(self, made: Sequence[ir.Stmt]) -> list[ir.Stmt]:
        """The given statements, each preceded by the calls hoisted from it. Nested bodies must already have been
        processed."""
        out: list[ir.Stmt] = []
        for s in made:
            out.append(self._statement(s, out))
        return out

    def _statement(self, s: ir.Stmt, out: list[ir.Stmt]) -> ir.Stmt:
        if isinstance(s, ir.If):
            return replace(s, condition=self.expr(s.condition, out))
        if isinstance(s, ir.Effect | ir.Event):
            return replace(s, args=self._arguments(s.args, out))
        if not isinstance(s, ir.Assign):
            return s
        if reaches_outside(s.target):  # Python evaluates the value before the target
            value = self._settled(self.expr(s.value, out), out)
            target = self.expr(s.target, out)
            assert isinstance(target, ir.Place)
            return replace(s, target=target, value=value)
        if isinstance(s.value, ir.EffectCall):
            return ir.Effect(s.value.function, self._arguments(s.value.args, out), s.target, s.span)
        return replace(s, value=self.expr(s.value, out))

    def expr(self, e: ir.Expr, out: list[ir.Stmt]) -> ir.Expr:
        """Appends the calls in the expression to `out`. Returns the expression with their results in place of the
        calls."""
        if not reaches_outside(e):
            return e
        if isinstance(e, ir.EffectCall):
            args = self._arguments(e.args, out)
            local = self._local(e.type, e.span)
            out.append(ir.Effect(e.function, args, local, e.span))
            return local
        if isinstance(e, ir.Choose):  # its branches contain no such calls: the checker rejects them
            return replace(e, condition=self.expr(e.condition, out))
        if isinstance(e, ir.Let):
            value = self.expr(e.value, out)
            if not reaches_outside(e.body):
                return replace(e, value=value)
            self.scope.types[e.name] = (value.type, value.span)
            out.append(ir.Assign(ir.Local(value.type, e.name, value.span), value, value.span))
            return self.expr(e.body, out)
        if isinstance(e, ir.ArrayValue | ir.StructValue):
            return replace(e, items=self._in_order(e.items, out))
        if isinstance(e, ir.Apply | ir.Elementwise | ir.Call):
            return replace(e, args=self._in_order(e.args, out))
        assert isinstance(e, ir.Member | ir.Element | ir.Slice)
        base = self.expr(e.base, out)
        assert isinstance(base, ir.Place)
        if any(map(reaches_outside, ir.children(e)[1:])):
            self.read_checked(base, out)
        if isinstance(e, ir.Element):
            return replace(e, base=base, indices=self._in_order(e.indices, out))
        if isinstance(e, ir.Slice):
            given = [s for s in e.subscripts if not isinstance(s, ir.Window)]
            found = iter(self._in_order(given, out))
            subscripts = tuple(s if isinstance(s, ir.Window) else next(found) for s in e.subscripts)
            return replace(e, base=base, subscripts=subscripts)
        return replace(e, base=base)

    def read_checked(self, place: ir.Place, out: list[ir.Stmt]) -> None:
        """Reads one scalar of a place that may be out of range. A fault then occurs before later subscripts are
        evaluated."""
        if not can_fault(place):
            return
        part = place
        while not isinstance(part.type, Scalar):
            if isinstance(part.type, Array):
                zeros = tuple(ir.Const(I64, 0, place.span) for _ in part.type.shape)
                part = ir.Element(part.type.element, part, zeros, tuple(False for _ in zeros), place.span)
            else:
                member = part.type.members[0]
                part = ir.Member(member.type, part, member.name, place.span)
        out.append(ir.Assign(self._local(part.type, place.span), part, place.span))

    def _in_order(self, parts: Sequence[ir.Expr], out: list[ir.Stmt]) -> tuple[ir.Expr, ...]:
        """Hoists from the parts in source order. Members of a struct may be given in any order."""
        order = sorted(range(len(parts)), key=lambda n: parts[n].span.key[1:])
        last = max((at for at, n in enumerate(order) if reaches_outside(parts[n])), default=-1)
        found = list(parts)
        for at, n in enumerate(order[: last + 1]):
            found[n] = self.expr(parts[n], out)
            if at < last:
                found[n] = self._settled(found[n], out)
        return tuple(found)

    def _arguments(self, args: Sequence[ir.Expr], out: list[ir.Stmt]) -> tuple[ir.Expr, ...]:
        """Arguments of a call that reaches outside. Each that may fault is computed before the call."""
        return tuple(self._settled(a, out) for a in self._in_order(args, out))

    def _settled(self, e: ir.Expr, out: list[ir.Stmt]) -> ir.Expr:
        """The value itself if it cannot fault, else a local that holds it."""
        if not can_fault(e):
            return e
        local = self._local(e.type, e.span)
        out.append(ir.Assign(local, e, e.span))
        return local

    def _local(self, type_: Type, span: Span) -> ir.Local:
        self._count += 1
        local = ir.Local(type_, f"outside.{self._count}", span)
        self.scope.types[local.name] = (type_, span)
        return local
