# SPDX-License-Identifier: Apache-2.0
"""What an `execute` may have written by the time it faults: that much, and no more, a fault must bring back."""

from __future__ import annotations

from ..model import ir
from ..model.effects import can_fault

#: (record, field) of what was written.
Written = frozenset[tuple[str, str]]


def written_before_fault(function: ir.Function) -> Written:
    """Fields of the records that may be written when some statement of the body faults.

    A statement that faults may have written its own target already. Every path is taken to be possible.
    """
    walk = _Walk()
    walk.body(function.body, frozenset())
    return walk.at_fault


class _Walk:
    def __init__(self) -> None:
        self.at_fault: Written = frozenset()

    def body(self, statements: tuple[ir.Stmt, ...], written: Written) -> Written:
        """What may be written by the end of these statements."""
        for s in statements:
            after = written | _target(s)
            if any(map(can_fault, ir.expressions(s))):
                self.at_fault |= after
            if isinstance(s, ir.If):
                after = self.body(s.then, written) | self.body(s.otherwise, written)
            elif isinstance(s, ir.For):
                # What a round writes stands when the next one faults.
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
