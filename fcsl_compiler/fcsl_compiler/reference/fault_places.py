# SPDX-License-Identifier: Apache-2.0
"""Location and cause of a fault: the innermost line of an algorithm's file in its traceback."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from types import TracebackType

from ..base.source import SourceFile
from .values import Fault

#: file, line, column, cause: a row of the table fault_places of fcsl_machine.h.
FaultRow = tuple[str, int, int, str]

INJECTED: FaultRow = ("", 0, 0, "injected")


class FaultPlaces:
    """Finds the numbers of faults in the table `rows` of the compiled machine with the algorithm files `sources`."""

    def __init__(self, rows: Sequence[FaultRow], sources: Sequence[SourceFile]):
        self._numbers = {row: number for number, row in enumerate(rows, 1)}
        self._sources = {str(Path(source.path).resolve()): source for source in sources}

    def number(self, fault: Fault) -> int:
        """Number of a fault's place. Raises KeyError if the table belongs to another program."""
        if fault.place is not None:
            path, begin, indent = fault.place
            return self._numbers[self._row(self._sources[path], begin, indent, fault)]
        frame: TracebackType | None = None
        at = fault.__traceback__
        while at is not None:
            frame = at if at.tb_frame.f_code.co_filename in self._sources else frame
            at = at.tb_next
        assert frame is not None, "a fault outside all algorithms"
        code = frame.tb_frame.f_code
        source = self._sources[code.co_filename]
        line, _, offset, _ = next(islice(code.co_positions(), frame.tb_lasti // 2, None))
        assert line is not None
        if offset is None:  # python -X no_debug_ranges: the first such fault of the line
            return next(n for p, n in self._numbers.items() if (p[0], p[1], p[3]) == (source.name, line, str(fault)))
        return self._numbers[self._row(source, line, offset, fault)]

    @staticmethod
    def _row(source: SourceFile, line: int, offset: int, fault: Fault) -> FaultRow:
        column = len(source.line(line).encode()[:offset].decode()) + 1
        return source.name, line, column, str(fault)

    @property
    def injected(self) -> int:
        return self._numbers[INJECTED]
