# SPDX-License-Identifier: Apache-2.0
"""Places samples with arbitrary times on the ticks of a machine, in integer arithmetic only.

Tick k is at t_k = t0 + k * 10^9 // tick_hz. At each tick the newest sample with time <= t_k is used. Samples are
ordered by (time, topic, index in the topic), so the result does not depend on how a bag interleaves its topics. Nothing
is interpolated: a sample is delivered once, at the first tick at which it is the newest, and then held. Times are int64
in ns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

_NS = 1_000_000_000
#: A larger step of a topic's times is a jump of its clock and not a late message.
JUMP_NS = _NS


def joined_rows(parts: Sequence[Array]) -> Array:
    """np.concatenate of arrays of one structured type. NumPy copies the fields of those one by one, but rows of bytes as
    a whole, which takes a tenth of the time."""
    kind = parts[0].dtype
    return np.concatenate([part.view(f"V{kind.itemsize}") for part in parts]).view(kind)


@dataclass(frozen=True)
class TickGrid:
    """The ticks of a run: tick k is at first_ns + k * 10^9 // tick_hz."""

    first_ns: int
    ticks: int
    tick_hz: int


@dataclass(frozen=True)
class Oddities:
    """Oddities in the times of one topic's messages, in bag order.

    unset: zero stamps. repeated: same time as the message before. late: earlier than the newest so far, by at most
    JUMP_NS. jumps_back: earlier by more than JUMP_NS. stuck: messages after such a jump, up to the first that is newer
    than all before it. jumps_ahead: steps forward that exceed those of the recording times by more than JUMP_NS.
    headerless: messages of a type without a stamp, where stamps were requested; their recording time is used.
    offset_ns: by how much the stamps are ahead of the recording times, in the middle; 0 without stamps.
    """

    unset: int = 0
    repeated: int = 0
    late: int = 0
    jumps_back: int = 0
    stuck: int = 0
    jumps_ahead: int = 0
    headerless: int = 0
    offset_ns: int = field(default=0, compare=False)


def screen(times_ns: Array, log_ns: Array, stamps: bool) -> tuple[Array, Oddities]:
    """Which messages of one topic have a usable time (bool, shape (N,)), and the oddities of all.

    `times_ns` are header stamps if `stamps` (zero means none), else times of recording.
    """
    usable = times_ns != 0 if stamps else np.ones(len(times_ns), bool)
    times, log = times_ns[usable], log_ns[usable]
    if not len(times):
        return usable, Oddities(unset=len(times_ns))
    offset_ns = int(np.median(times - log)) if stamps else 0
    steps = np.diff(times, prepend=times[0])
    if len(times) > 1 and steps[1:].min() > 0 and steps.max() <= JUMP_NS:  # as usual: in order, and nothing jumps
        return usable, Oddities(unset=len(times_ns) - len(times), offset_ns=offset_ns)
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
        offset_ns=offset_ns,
    )
    usable[usable] = ~stuck
    return usable, oddities


@dataclass(frozen=True)
class Coverage:
    """Counts of one channel's samples.

    used: delivered. superseded: replaced by a newer one before the next tick. held: ticks that kept an older sample.
    waiting: ticks before the first sample. largest_gap_ns: largest time between two consecutive samples.
    """

    used: int
    superseded: int
    held: int
    waiting: int
    largest_gap_ns: int


def first_tick_at(time_ns: int, first_ns: int, tick_hz: int) -> int:
    """The first tick with t_k >= time_ns; 0 for times up to first_ns."""
    wait = time_ns - first_ns
    # floor(k * 1e9 / hz) >= wait if and only if k >= wait * hz / 1e9.
    return 0 if wait <= 0 else -(-wait * tick_hz // _NS)


def first_ticks_at(times_ns: Array, first_ns: int, tick_hz: int) -> Array:
    """`first_tick_at` of each time; exact while the tick numbers are below 2^33."""
    wait = np.maximum(times_ns - first_ns, 0)
    seconds, rest = wait // _NS, wait % _NS
    return seconds * tick_hz - (-rest * tick_hz // _NS)


def tick_times(ticks: Array, first_ns: int, tick_hz: int) -> Array:
    """t_k of each tick in ns."""
    return first_ns + ticks // tick_hz * _NS + ticks % tick_hz * _NS // tick_hz


def nearest_ticks(times_ns: Array, first_ns: int, tick_hz: int) -> Array:
    """The tick nearest to each time; of two equally near, the earlier."""
    after = first_ticks_at(times_ns, first_ns, tick_hz)
    before = np.maximum(after - 1, 0)
    wait = tick_times(after, first_ns, tick_hz) - times_ns
    return np.where(times_ns - tick_times(before, first_ns, tick_hz) <= wait, before, after)


def tick_count(first_ns: int, last_ns: int, tick_hz: int) -> int:
    """Ticks of the grid from first_ns up to the one that receives a sample of last_ns."""
    return first_tick_at(last_ns, first_ns, tick_hz) + 1


def align(times_ns: Array, first_ns: int, ticks: int, tick_hz: int) -> tuple[Array, Array, Coverage]:
    """(ticks at which a sample is delivered, index of each sample, counts).

    `times_ns` is sorted by topic and then by index in the topic, which decides between samples of the same time.
    """
    if len(times_ns) < 2 or np.diff(times_ns).min() >= 0:  # as usual
        order, ordered = np.arange(len(times_ns)), times_ns
    else:
        order = np.argsort(times_ns, kind="stable")
        ordered = times_ns[order]
    due = first_ticks_at(ordered, first_ns, tick_hz)
    if len(due) and due[-1] >= ticks:
        raise ValueError(f"a sample of {ordered[-1]} ns is later than the grid")
    # Of several samples for one tick, keep the last, which is the newest.
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
