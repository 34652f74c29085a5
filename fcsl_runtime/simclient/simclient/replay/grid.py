# SPDX-License-Identifier: Apache-2.0
"""Puts samples with times of their own onto the ticks of a machine, with integers only.

Tick k stands at t_k = t0 + k * 10^9 // tick_hz. At each tick the newest sample with time <= t_k is in force; samples
are ordered by (time, topic, index in the topic), so the result does not depend on how a bag interleaves its topics.
Nothing is interpolated: a sample is delivered once, at the first tick at which it is the newest, and then held.
Times are int64 in ns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

_NS = 1_000_000_000
#: A step of a topic's times that is larger than this is a jump of its clock, not a message that came late.
JUMP_NS = _NS


@dataclass(frozen=True)
class Grid:
    """The ticks of a run: tick k stands at first_ns + k * 10^9 // tick_hz."""

    first_ns: int
    ticks: int
    tick_hz: int


@dataclass(frozen=True)
class Oddities:
    """What is odd about the times of one topic's messages, in the order of the bag.

    unset: zero stamps. repeated: the time of the message before. late: before the newest one so far, by JUMP_NS at most.
    jumps_back: steps back by more. stuck: messages after such a step, up to the first that is newer than all before it.
    jumps_ahead: steps ahead of more than JUMP_NS beyond what the times of recording say.
    headerless: messages of a type that has no stamp, though stamps were asked for; they have the time of recording.
    """

    unset: int = 0
    repeated: int = 0
    late: int = 0
    jumps_back: int = 0
    stuck: int = 0
    jumps_ahead: int = 0
    headerless: int = 0


def screen(times_ns: Array, log_ns: Array, stamps: bool) -> tuple[Array, Oddities]:
    """Which messages of one topic have a time that can be used (bool), and what is odd about them all.

    `times_ns` are header stamps (`stamps`), of which zero says that there is none, or else the times of recording.
    """
    usable = times_ns != 0 if stamps else np.ones(len(times_ns), bool)
    times, log = times_ns[usable], log_ns[usable]
    if not len(times):
        return usable, Oddities(unset=len(times_ns))
    steps = np.diff(times, prepend=times[0])
    newest_before = np.concatenate((times[:1], np.maximum.accumulate(times)[:-1]))
    behind = newest_before - times
    index = np.arange(len(times))
    last_fall = np.maximum.accumulate(np.where(behind > JUMP_NS, index, -1))
    last_newest = np.maximum.accumulate(np.where(behind < 0, index, -1))
    stuck = last_fall > last_newest
    repeated = steps[1:] == 0
    ahead = steps - np.diff(log, prepend=log[0]) > JUMP_NS if stamps else np.zeros(len(times), bool)
    oddities = Oddities(
        unset=len(times_ns) - len(times),
        repeated=int(np.count_nonzero(repeated)),
        late=int(np.count_nonzero((behind > 0) & ~stuck)),
        jumps_back=int(np.count_nonzero(steps < -JUMP_NS)),
        stuck=int(np.count_nonzero(stuck)),
        jumps_ahead=int(np.count_nonzero(ahead & (steps > JUMP_NS))),
    )
    usable[usable] = ~stuck
    return usable, oddities


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


def first_ticks_at(times_ns: Array, first_ns: int, tick_hz: int) -> Array:
    """`first_tick_at` of each; exact while the ticks between first_ns and each of them number less than 2^33."""
    wait = np.maximum(times_ns - first_ns, 0)
    seconds, rest = wait // _NS, wait % _NS
    return seconds * tick_hz - (-rest * tick_hz // _NS)


def tick_times(ticks: Array, first_ns: int, tick_hz: int) -> Array:
    """t_k of each tick."""
    return first_ns + ticks // tick_hz * _NS + ticks % tick_hz * _NS // tick_hz


def nearest_ticks(times_ns: Array, first_ns: int, tick_hz: int) -> Array:
    """The tick nearest in time to each time; the earlier of two as near."""
    after = first_ticks_at(times_ns, first_ns, tick_hz)
    before = np.maximum(after - 1, 0)
    wait = tick_times(after, first_ns, tick_hz) - times_ns
    return np.where(times_ns - tick_times(before, first_ns, tick_hz) <= wait, before, after)


def tick_count(first_ns: int, last_ns: int, tick_hz: int) -> int:
    """Ticks of the grid from first_ns up to the one that still sees a sample of last_ns."""
    return first_tick_at(last_ns, first_ns, tick_hz) + 1


def place(times_ns: Array, first_ns: int, ticks: int, tick_hz: int) -> tuple[Array, Array, Coverage]:
    """(ticks at which a sample is delivered, the index of each, the account of it).

    `times_ns` stand in the order in which samples of the same time count: by topic, then by index in the topic.
    """
    order = np.argsort(times_ns, kind="stable")
    ordered = times_ns[order]
    due = first_ticks_at(ordered, first_ns, tick_hz)
    if len(due) and due[-1] >= ticks:
        raise ValueError(f"a sample of {ordered[-1]} ns lies behind the grid")
    # Of several for one tick the last, which is the newest, stays.
    stays = np.append(due[1:] != due[:-1], True) if len(due) else np.empty(0, bool)
    waiting = int(due[0]) if len(due) else ticks
    used = int(np.count_nonzero(stays))
    coverage = Coverage(
        used=used,
        superseded=len(ordered) - used,
        held=ticks - waiting - used,
        waiting=waiting,
        largest_gap_ns=int(np.diff(ordered).max(initial=0)),
    )
    return due[stays], order[stays], coverage
