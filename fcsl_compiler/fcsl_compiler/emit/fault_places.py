# SPDX-License-Identifier: Apache-2.0
"""Numbers the places where an algorithm may fault, from 1: the table fault_places of fcsl_machine.h.

The code of a faulting operation contains the number and stores it when the fault occurs. Instances and specialised
functions share the numbers of their common source.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..base.source import Span
from ..model import ir
from ..model.machine import Machine
from ..model.types import shape_of


@dataclass(frozen=True, order=True)
class FaultPlace:
    """One row of the table."""

    file: str  # as shown in messages; "" if no line of a source causes the fault
    line: int
    column: int
    cause: str


#: Cause of a fault that a host injects (inject_fault).
INJECTED = FaultPlace("", 0, 0, "injected")


def index_cause(extent: int) -> str:
    """Cause of the fault of an index into a dimension of this size."""
    return f"the index is outside [0, {extent})"


class FaultPlaces:
    """All places of a machine: first that of injected faults, then those of the emitted functions, in the order of
    their files."""

    def __init__(self, machine: Machine):
        found: set[FaultPlace] = set()
        for function, _ in machine.emitted:
            for s in ir.walk(function.body):
                for e in ir.expressions(s):
                    _collect(e, found)
        self.rows = (INJECTED, *sorted(found))
        self._numbers = {row: number for number, row in enumerate(self.rows, 1)}

    def number(self, span: Span, cause: str) -> int:
        return self._numbers[_place(span, cause)]

    @property
    def injected(self) -> int:
        return self._numbers[INJECTED]


def _place(span: Span, cause: str) -> FaultPlace:
    return FaultPlace(span.source.name, span.line, span.column, cause)


def _collect(e: ir.Expr, found: set[FaultPlace]) -> None:
    if (isinstance(e, ir.Apply) and e.fault) or isinstance(e, ir.Elementwise):
        found.update(_place(e.span, cause) for cause in e.op.faults)
    elif isinstance(e, ir.Element | ir.Slice):
        found.update(
            _place(e.span, index_cause(extent))
            for extent, checked in zip(shape_of(e.base.type), e.checked, strict=False)
            if checked
        )
    for child in ir.children(e):
        _collect(child, found)
