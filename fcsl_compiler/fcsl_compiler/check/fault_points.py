# SPDX-License-Identifier: Apache-2.0
"""Determines which fields an `execute` may have written when it faults. Exactly these must be restored. Each run copies
them, or, of a large field, the elements that it writes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir
from ..model.effects import can_fault
from ..model.types import Type, count_of, leaves, scalar_of

#: (record, field).
Field = tuple[str, str]
Written = frozenset[Field]
#: These are reset before each run and by a fault, and never restored.
PULSES = frozenset({("outputs", "transition_request"), ("outputs", "health")})
#: Smaller fields take no more than a tenth of a microsecond.
_LARGE_BYTES = 4096
#: Smaller fields are copied whole: it costs no more than to remember elements.
_UNDONE_BYTES = 256


def written_before_fault(function: ir.Function) -> Written:
    """Fields of the records that may be written when a statement of the body faults, apart from pulses and from those
    that the lowered function restores itself.

    A faulting statement may already have written its target. All paths are considered possible.
    """
    return frozenset(_places(function)) - PULSES - {ir.variable(u.part) for u in function.undone}


def undoable_writes(function: ir.Function) -> dict[Field, list[ir.Assign]]:
    """Large fields of which a fault can restore single parts, with the assignments that write those parts: all writes to
    the field, few and outside loops."""
    found: dict[Field, list[ir.Assign]] = {field: [] for field in _places(function)}
    for s, in_loop in _statements(function.body, False):
        for field in _target(s):
            if field in found and not in_loop and isinstance(s, ir.Assign) and _can_be_undone(s.target):
                found[field].append(s)
            else:
                found.pop(field, None)
    return {field: writes for field, writes in found.items() if writes and _are_small(writes)}


def _statements(body: tuple[ir.Stmt, ...], in_loop: bool) -> Iterator[tuple[ir.Stmt, bool]]:
    for s in body:
        yield s, in_loop
        if isinstance(s, ir.If):
            yield from _statements(s.then, in_loop)
            yield from _statements(s.otherwise, in_loop)
        elif isinstance(s, ir.For):
            yield from _statements(s.body, True)


def _can_be_undone(target: ir.Place) -> bool:
    """A part whose indices can be computed before any is checked, with the same fault."""
    indices = list(_indices(target))
    return target != ir.root(target) and not any(map(can_fault, indices[1:]))


def _indices(place: ir.Place) -> Iterator[ir.Expr]:
    """In the order in which they are computed."""
    if isinstance(place, ir.Member | ir.Element | ir.Slice):
        yield from _indices(place.base)
        yield from ir.children(place)[1:]


def _are_small(writes: Sequence[ir.Assign]) -> bool:
    """Whether the parts are small beside their field."""
    whole = _bytes(ir.root(writes[0].target).type)
    return whole >= _UNDONE_BYTES and 2 * sum(_bytes(s.target.type) for s in writes) <= whole


def _bytes(type_: Type) -> int:
    return sum(count_of(leaf.type) * scalar_of(leaf.type).size for leaf in leaves(type_))


def rollback_bytes(function: ir.Function, ports: Mapping[str, Sequence[ir.Port]]) -> int:
    """Bytes that each run of a lowered `execute` copies, so that a fault can undo what it wrote."""
    written = written_before_fault(function)
    whole = (_bytes(p.type) for record in ("outputs", "state") for p in ports[record] if (record, p.name) in written)
    return sum(whole) + sum(_bytes(u.part.type) for u in function.undone)


def warn_copies(found: ir.Function, ports: Mapping[str, Sequence[ir.Port]], sink: DiagnosticSink) -> None:
    """W307: large fields that a fault would have to restore."""
    places = _places(found)
    undone = undoable_writes(found)
    for record in ("outputs", "state"):
        for port in ports[record]:
            if (record, port.name) not in places or (record, port.name) in undone:
                continue
            size = _bytes(port.type)
            if size <= _LARGE_BYTES:
                continue
            message = (
                f"each run copies the {size} bytes of `{port.name}`, so that a fault can undo what is written to it"
            )
            why = "it is written as a whole or in a loop, and something may fault there or later"
            fix = "write single elements outside loops, or use what cannot fault: `% SIZE` of an unsigned index, `wrap_add`"
            notes = [(places[record, port.name], "this may fault")]
            sink.warning("W307", message, port.span, why=why, help=fix, notes=notes)


def _places(function: ir.Function) -> dict[Field, Span]:
    """The fields that may be written when a statement faults, with the first such statement."""
    walk = _Walk()
    walk.body(function.body, frozenset())
    return walk.at_fault


class _Walk:
    def __init__(self) -> None:
        self.at_fault: dict[Field, Span] = {}

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
