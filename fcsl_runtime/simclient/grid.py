# SPDX-License-Identifier: Apache-2.0
"""Puts samples with times of their own onto the ticks of a machine, with integers only.

Tick k stands at t_k = t0 + k * 10^9 // tick_hz. At each tick the newest sample with time <= t_k is in force; samples
are ordered by (time, topic, index in the topic), so the result does not depend on how a bag interleaves its topics.
Nothing is interpolated: a sample is delivered once, at the first tick at which it is the newest, and then held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

_NS = 1_000_000_000


@dataclass(frozen=True, order=True)
class Sample:
    """When a message was, where it came from, and its number in its topic."""

    time_ns: int
    topic: str
    index: int


@dataclass(frozen=True)
class Coverage:
    """What became of one channel's samples.

    used: delivered. superseded: never in force, because a newer one came before the next tick. held: ticks that went on
    with an older sample. waiting: ticks before the first sample. largest_gap_ns: between two consecutive samples.
    """

    used: int
    superseded: int
    held: int
    waiting: int
    largest_gap_ns: int


def first_tick_at(time_ns: int, first_ns: int, tick_hz: int) -> int:
    """The first tick with t_k >= time_ns; 0 for times up to first_ns."""
    wait = time_ns - first_ns
    # floor(k * 1e9 / hz) >= wait holds exactly for k >= wait * hz / 1e9.
    return 0 if wait <= 0 else -(-wait * tick_hz // _NS)


def tick_count(first_ns: int, last_ns: int, tick_hz: int) -> int:
    """Ticks of the grid from first_ns up to the one that still sees a sample of last_ns."""
    return first_tick_at(last_ns, first_ns, tick_hz) + 1


def place(samples: Sequence[Sample], first_ns: int, ticks: int, tick_hz: int) -> tuple[dict[int, Sample], Coverage]:
    """Which sample is delivered at which of the `ticks` ticks, and the account of it."""
    ordered = sorted(samples)
    delivered: dict[int, Sample] = {}
    for sample in ordered:
        tick = first_tick_at(sample.time_ns, first_ns, tick_hz)
        if tick >= ticks:
            raise ValueError(f"a sample of {sample.time_ns} ns lies behind the grid")
        delivered[tick] = sample  # of several for one tick the last, which is the newest, stays
    waiting = min(delivered, default=ticks)
    gaps = [b.time_ns - a.time_ns for a, b in zip(ordered, ordered[1:], strict=False)]
    coverage = Coverage(
        used=len(delivered),
        superseded=len(ordered) - len(delivered),
        held=ticks - waiting - len(delivered),
        waiting=waiting,
        largest_gap_ns=max(gaps, default=0),
    )
    return delivered, coverage
