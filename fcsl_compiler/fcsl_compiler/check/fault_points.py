# SPDX-License-Identifier: Apache-2.0
"""Determines which fields an `execute` may have written when it faults. Exactly these must be restored, and each run copies
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.effects import can_fault
from ..model.types import count_of, leaves, scalar_of

#: (record, field) of a written field.
Written = frozenset[tuple[str, str]]
#: Smaller fields take no more than a tenth of a microsecond.
_LARGE_BYTES = 4096


def written_before_fault(function: ir.Function) -> Written:
    """Fields of the records that may be written when a statement of the body faults.

    A faulting statement may already have written its target. All paths are considered possible.
    """
    return frozenset(_places(function))


def warn_copies(found: ir.Function, ports: Mapping[str, Sequence[ir.Port]], sink: DiagnosticSink) -> None:
    """W307: large fields that a fault would have to restore."""
    places = _places(found)
    for record in ("outputs", "state"):
        for port in ports[record]:
            if (record, port.name) not in places:
                continue
            size = sum(count_of(leaf.type) * scalar_of(leaf.type).size for leaf in leaves(port.type))
            if size <= _LARGE_BYTES:
                continue
            message = (
                f"each run copies the {size} bytes of `{port.name}`, so that a fault can undo what is written to it"
            )
            why = "a statement that may fault stands at or behind the first write"
            fix = "make it free of faults: `% SIZE` of an unsigned index, `wrap_add`; or write to it at the end"
            notes = [(places[record, port.name], "this may fault")]
            sink.warning("W307", message, port.span, why=why, help=fix, notes=notes)


def _places(function: ir.Function) -> dict[tuple[str, str], Span]:
    """The fields that may be written when a statement faults, with the first such statement."""
    walk = _Walk()
    walk.body(function.body, frozenset())
    return walk.at_fault


class _Walk:
    def __init__(self) -> None:
        self.at_fault: dict[tuple[str, str], Span] = {}

    def body(self, statements: tuple[ir.Stmt, ...], written: Written) -> Written:
        """Fields that may be written by the end of these statements."""
        for s in statements:
            after = written | _target(s)
            if any(map(can_fault, ir.expressions(s))):
                for field in after:
                    self.at_fault.setdefault(field, s.span)
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
