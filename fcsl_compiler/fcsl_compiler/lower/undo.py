# SPDX-License-Identifier: Apache-2.0
"""Makes `execute` remember the elements of a large array that it writes. A fault puts them back, so a run need not copy
the whole array.

    self.buffer[self.head] = self.x      index.0 = self.head
                                         before.1 = self.buffer[index.0]      may fault; nothing is written yet
                                         self.buffer[index.0] = self.x        from here on, a fault restores before.1
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..check.fault_points import undoable_writes
from ..model import ir
from ..model.effects import can_fault
from ..model.types import Type


def with_undo(execute: ir.Function) -> ir.Function:
    """Rewrites an `execute`. Returns the same one if nothing changes."""
    writes = [w for written in undoable_writes(execute).values() for w in written]
    if not writes:
        return execute
    made = _Undo(writes, execute.body)
    body = made.body(execute.body, always=True)
    return replace(
        execute, body=(*made.first, *body), locals=(*execute.locals, *made.locals), undone=tuple(made.undone)
    )


class _Undo:
    def __init__(self, writes: Sequence[ir.Assign], execute: tuple[ir.Stmt, ...]):
        self.writes = {id(w) for w in writes}
        order = list(ir.walk(execute))
        last = max(n for n, s in enumerate(order) if any(map(can_fault, ir.expressions(s))))
        #: Behind these statements, none may fault.
        self.final = {id(s) for s in order[last:]}
        self.locals: list[tuple[str, Type]] = []
        #: Where a branch may not be taken, element 0 is restored.
        self.first: list[ir.Stmt] = []
        self.undone: list[ir.Undo] = []

    def body(self, statements: tuple[ir.Stmt, ...], always: bool) -> tuple[ir.Stmt, ...]:
        made: list[ir.Stmt] = []
        for s in statements:
            if isinstance(s, ir.If):
                made.append(replace(s, then=self.body(s.then, False), otherwise=self.body(s.otherwise, False)))
            elif isinstance(s, ir.Assign) and id(s) in self.writes:
                made += self._write(s, always)
            else:
                made.append(s)
        return tuple(made)

    def _write(self, s: ir.Assign, always: bool) -> list[ir.Stmt]:
        """In the order of Python: the value, the indices, the element."""
        value, made = s.value, list[ir.Stmt]()
        if not isinstance(value, ir.Const):
            value = self._local("value", s.value, made)
        place = self._held(s.target, made)
        before = self._local("before", place, made)
        part = _unchecked(place)
        if id(s) not in self.final:
            self.undone.append(ir.Undo(part, before))
            if not always:
                self.first.append(ir.Assign(before, _at_zero(part), s.span))
        return [*made, ir.Assign(part, value, s.span)]

    def _local(self, what: str, value: ir.Expr, made: list[ir.Stmt]) -> ir.Local:
        """A new local that holds the value."""
        local = ir.Local(value.type, f"{what}.{len(self.locals)}", value.span)
        self.locals.append((local.name, local.type))
        made.append(ir.Assign(local, value, value.span))
        return local

    def _held(self, place: ir.Place, made: list[ir.Stmt]) -> ir.Place:
        """The same place, with indices that are constants and locals."""
        if isinstance(place, ir.Member):
            return replace(place, base=self._held(place.base, made))
        if isinstance(place, ir.Element):
            base = self._held(place.base, made)
            return replace(place, base=base, indices=tuple(self._index(i, made) for i in place.indices))
        if isinstance(place, ir.Slice):
            base = self._held(place.base, made)
            held = (s if isinstance(s, ir.Window) else self._index(s, made) for s in place.subscripts)
            return replace(place, base=base, subscripts=tuple(held))
        return place

    def _index(self, index: ir.Expr, made: list[ir.Stmt]) -> ir.Expr:
        return index if isinstance(index, ir.Const) else self._local("index", index, made)


def _unchecked(place: ir.Place) -> ir.Place:
    if isinstance(place, ir.Member):
        return replace(place, base=_unchecked(place.base))
    if isinstance(place, ir.Element | ir.Slice):
        return replace(place, base=_unchecked(place.base), checked=(False,) * len(place.checked))
    return place


def _at_zero(place: ir.Place) -> ir.Place:
    """The place that the locals name before they are assigned."""
    if isinstance(place, ir.Member):
        return replace(place, base=_at_zero(place.base))
    if isinstance(place, ir.Element):
        return replace(place, base=_at_zero(place.base), indices=tuple(map(_zero, place.indices)))
    if isinstance(place, ir.Slice):
        subscripts = tuple(s if isinstance(s, ir.Window) else _zero(s) for s in place.subscripts)
        return replace(place, base=_at_zero(place.base), subscripts=subscripts)
    return place


def _zero(index: ir.Expr) -> ir.Expr:
    return ir.Const(index.type, 0, index.span) if isinstance(index, ir.Local) else index
