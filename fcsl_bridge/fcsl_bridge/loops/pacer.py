# SPDX-License-Identifier: Apache-2.0
"""When a machine ticks in real time: due times on CLOCK_MONOTONIC, and statistics of lateness.

Tick j is due floor(j * 1e9 / tick_hz) ns after the first. A deadline is *missed* when the next tick is due before this one
began. Missed ticks are not made: the newest due tick, less than a period late, is made at once. This is the policy
`--missed-deadline skip` of fcsl-fc (fc/pacing.c).
"""

from __future__ import annotations

import bisect
import ctypes
import os
import time

_NS = 1_000_000_000
#: Upper edges of the lateness histogram in microseconds; one more bin counts larger values.
BINS_US = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)
_TIMER_ABSTIME = 1


class _Timespec(ctypes.Structure):
    """struct timespec; time_t is a long on every Linux for which Python wheels of ROS 2 exist."""

    _fields_ = [("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long)]


_nanosleep = ctypes.CDLL(None).clock_nanosleep
_nanosleep.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.POINTER(_Timespec), ctypes.c_void_p]


def sleep_until(deadline_ns: int) -> None:
    """Sleeps until CLOCK_MONOTONIC reads deadline_ns, or a signal arrives. Python's sleep is relative: a process
    that is preempted between reading the clock and sleeping would oversleep."""
    status = _nanosleep(time.CLOCK_MONOTONIC, _TIMER_ABSTIME, _Timespec(*divmod(deadline_ns, _NS)), None)
    if status not in (0, 4):  # EINTR: the caller reads the clock again
        raise OSError(status, os.strerror(status), "clock_nanosleep")


class Pacer:
    """The deadlines of `tick_hz`, from `start` on, and the counts of all ticks since construction."""

    def __init__(self, tick_hz: int):
        self._hz = tick_hz
        self._anchor_ns = self._next = 0
        self.missed = self.worst_ns = 0
        self.histogram = [0] * (len(BINS_US) + 1)

    def start(self, now_ns: int) -> None:
        """The first deadline is now."""
        self._anchor_ns, self._next = now_ns, 0

    @property
    def deadline_ns(self) -> int:
        """Deadline of the next tick."""
        return self._deadline(self._next)

    def begin(self, now_ns: int) -> int:
        """Counts a tick that begins at its deadline or later; returns the deadline that it serves."""
        lateness = now_ns - self.deadline_ns
        newest = ((now_ns - self._anchor_ns + 1) * self._hz - 1) // _NS
        self.missed += newest - self._next
        self.worst_ns = max(self.worst_ns, lateness)
        self.histogram[bisect.bisect_left(BINS_US, lateness / 1000)] += 1
        self._next = newest + 1
        return self._deadline(newest)

    def figures(self) -> dict[str, int | float]:
        """Lateness in microseconds: the worst, and how many ticks up to each edge of the histogram."""
        edges = [f"lateness <= {edge} us" for edge in BINS_US] + [f"lateness > {BINS_US[-1]} us"]
        return {"lateness worst us": self.worst_ns / 1000, **dict(zip(edges, self.histogram, strict=True))}

    def _deadline(self, number: int) -> int:
        return self._anchor_ns + number * _NS // self._hz
