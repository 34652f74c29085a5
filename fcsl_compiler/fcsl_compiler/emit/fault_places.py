# SPDX-License-Identifier: Apache-2.0
"""Where an algorithm may fault, numbered from 1: the table fault_places of fcsl_machine.h.

The number stands in the C of the operation that faults, and is what a fault leaves behind. Instances and the variants of a function
share the numbers, since they share the source.
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

    file: str  # as messages name it; "" for what no line of a source does
    line: int
    column: int
    cause: str


#: What a host does to an instance (inject_fault).
INJECTED = FaultPlace("", 0, 0, "injected")


def index_cause(extent: int) -> str:
    """Why an index into a dimension of this extent faults."""
    return f"the index is outside [0, {extent})"


class FaultPlaces:
    """All places of a machine: that of injected faults, then those of the functions that are emitted, in the order of their files."""

    def __init__(self, machine: Machine):
        found: set[FaultPlace] = set()
        for function, _ in machine.emitted:
            for s in ir.walk(function.body):
                for e in ir.expressions(s):
                    _collect(e, found)
        self.rows = (INJECTED, *sorted(found))
        self._numbers = {row: number for number, row in enumerate(self.rows, 1)}

    def number(self, span: Span, cause: str) -> str:
        """The number of a place as C spells it."""
        return f"{self._numbers[_place(span, cause)]}u"

    @property
    def injected(self) -> str:
        return f"{self._numbers[INJECTED]}u"


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
