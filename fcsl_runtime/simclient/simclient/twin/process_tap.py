# SPDX-License-Identifier: Apache-2.0
"""ProcessTap: rows of a machine in another process, extracted from its state after every tick."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from ..errors import TwinError


class ProcessTap:
    """The last `capacity` rows (host.Tap). `others` are all open taps of the twin, including this one."""

    def __init__(self, ranges: Sequence[tuple[int, int]], capacity: int, others: list[ProcessTap]):
        self.capacity = capacity
        self._ranges, self._others = tuple(ranges), others
        self._kept: deque[bytes] = deque(maxlen=capacity)
        self._rows = 0
        others.append(self)

    def skip(self, ticks: int) -> None:
        """Counts ticks without reading their rows: at least `capacity` more ticks follow."""
        self._rows += ticks
        self._kept.clear()

    def take(self, data: bytes) -> None:
        """Takes the machine struct after a tick."""
        self._kept.append(b"".join([data[offset : offset + size] for offset, size in self._ranges]))
        self._rows += 1

    def rows(self) -> int:
        """Rows taken so far, including discarded ones."""
        return self._rows

    def read(self, first: int, count: int) -> bytes:
        """`count` rows from row `first` on. Raises TwinError if they were discarded."""
        begin = first - (self._rows - len(self._kept))
        if begin < 0 or count < 0 or begin + count > len(self._kept):
            raise TwinError(f"rows {first} to {first + count - 1} are not kept")
        return b"".join([self._kept[i] for i in range(begin, begin + count)])

    def close(self) -> None:
        if self in self._others:
            self._others.remove(self)
