# SPDX-License-Identifier: Apache-2.0
"""Which ticks a time of /clock makes due.

The first time is that of tick 0; tick j is due floor(j * 1e9 / tick_hz) ns after it.
"""

from __future__ import annotations

_NS = 1_000_000_000


class ClockTicks:
    """`most`: how many ticks one time makes due; older ones are skipped and counted."""

    def __init__(self, tick_hz: int, most: int):
        self._hz, self._most = tick_hz, most
        self._anchor_ns: int | None = None
        self._next = self._seen_ns = 0
        self.skipped = 0  #: ticks
        self.set_back = 0  #: how often the clock went back; ticks then count from its new time

    def start(self) -> None:
        """The next time is that of the first tick."""
        self._anchor_ns = None

    def until(self, now_ns: int) -> list[int]:
        """The due times of the ticks that are due at now_ns, in ns of the clock, oldest first."""
        if self._anchor_ns is None or now_ns < self._seen_ns:
            self.set_back += self._anchor_ns is not None
            self._anchor_ns, self._next = now_ns, 0
        self._seen_ns = now_ns
        newest = ((now_ns - self._anchor_ns + 1) * self._hz - 1) // _NS
        first = max(self._next, newest + 1 - self._most)
        self.skipped += first - self._next
        self._next = newest + 1
        return [self._anchor_ns + number * _NS // self._hz for number in range(first, newest + 1)]
