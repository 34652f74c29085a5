# SPDX-License-Identifier: Apache-2.0
"""Determines which fields an `execute` may have written when it faults. Exactly these must be restored."""

from __future__ import annotations

from ..model import ir
from ..model.effects import can_fault

#: (record, field) of a written field.
Written = frozenset[tuple[str, str]]


def written_before_fault(function: ir.Function) -> Written:
    """Fields of the records that may be written when a statement of the body faults.

    A faulting statement may already have written its target. All paths are considered possible.
    """
    walk = _Walk()
    walk.body(function.body, frozenset())
    return walk.at_fault


class _Walk:
    def __init__(self) -> None:
        self.at_fault: Written = frozenset()

    def body(self, statements: tuple[ir.Stmt, ...], written: Written) -> Written:
        """Fields that may be written by the end of these statements."""
        for s in statements:
            after = written | _target(s)
            if any(map(can_fault, ir.expressions(s))):
                self.at_fault |= after
            if isinstance(s, ir.If):
                after = self.body(s.then, written) | self.body(s.otherwise, written)
            elif isinstance(s, ir.For):
                # Writes of one iteration are present when the next iteration faults.
                after = self.body(s.body, written.union(*map(_target, ir.walk(s.body))))
            written = after
        return written


def _target(s: ir.Stmt) -> Written:
    """The field that a statement writes, wholly or in part."""
    if isinstance(s, ir.Assign | ir.Effect) and s.target is not None:
        place = ir.root(s.target)
        if isinstance(place, ir.Field):
            return frozenset({(place.record, place.name)})
    return frozenset()
