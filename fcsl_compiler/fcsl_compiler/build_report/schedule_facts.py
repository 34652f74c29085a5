# SPDX-License-Identifier: Apache-2.0
"""Ticks at which the instances of a state are due, and the age of values when they are used."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..model.machine import Connection, Entry, Machine, State

#: Maximum number of sets of entries that are due together. With more, no list is made.
MOST_SLOTS = 256
#: Upper limit of tick numbers.
NEVER = 1 << 62


@dataclass(frozen=True)
class Slot:
    """Ticks of the major cycle at which the same entries are due: their number, the first of them, and the positions of
    the entries."""

    ticks: int
    first: int
    due: tuple[int, ...]


@dataclass(frozen=True)
class Latency:
    """Ticks between the execute that computed a value and the one that uses it, over the major cycle, after both have
    run."""

    least: int
    most: int


def major_cycle(entries: Iterable[Entry]) -> int:
    """Number of ticks after which the pattern of due instances repeats."""
    return math.lcm(*(e.divisor for e in entries))


def slots(entries: Sequence[Entry]) -> list[Slot] | None:
    """Slots in the order of their first ticks, without those beyond the upper limit of ticks. None if there are more
    than MOST_SLOTS."""
    meetings = _meetings(entries)
    if meetings is None:
        return None
    cycle = major_cycle(entries)
    due = {
        m: tuple(n for n, e in enumerate(entries) if m[1] % e.divisor == 0 and m[0] % e.divisor == e.phase)
        for m in meetings
    }
    found: list[Slot] = []
    for (first, period), positions in sorted(due.items(), key=lambda item: -len(item[1])):
        ticks = cycle // period - sum(s.ticks for s in found if set(positions) < set(s.due))
        if ticks > 0:
            alone = (t for t in range(first, cycle, period) if _due(entries, t) == positions)
            found.append(Slot(ticks, next(alone), positions))
    return sorted((s for s in found if s.first < NEVER), key=lambda s: s.first)


def _due(entries: Sequence[Entry], tick: int) -> tuple[int, ...]:
    return tuple(n for n, e in enumerate(entries) if tick % e.divisor == e.phase)


def _meetings(entries: Sequence[Entry]) -> set[tuple[int, int]] | None:
    """All (first tick, period) at which a subset of the entries coincides. The ticks at which given entries are all due
    are congruent modulo the least common multiple of their divisors, or there are none (Chinese remainder theorem).
    None if there are too many."""
    found = {(0, 1)}
    pending = [(0, 1)]
    while pending:
        first, period = pending.pop()
        for divisor, phase in {(e.divisor, e.phase) for e in entries}:
            common = math.gcd(period, divisor)
            if (phase - first) % common == 0:
                turns = (phase - first) // common * pow(period // common, -1, divisor // common) % (divisor // common)
                both = (first + period * turns, period // common * divisor)
                if both not in found:
                    found.add(both)
                    pending.append(both)
        if len(found) > MOST_SLOTS:
            return None
    return found


def latency(source: Entry, target: Entry, delayed: bool) -> Latency:
    """Latency of a connection between two entries of one state. A source that is not delayed precedes its target in the
    state's order, so if both are due, the value is of the same tick. A delayed connection gives the value at the
    beginning of the tick.

    The source last ran r ticks ago with r = (tick - its phase) mod its divisor. At the target's ticks, r takes exactly
    the values that are congruent modulo the greatest common divisor of both divisors.
    """
    common = math.gcd(source.divisor, target.divisor)
    least = (target.phase - source.phase - delayed) % common
    return Latency(least + delayed, source.divisor - common + least + delayed)


def latency_of(machine: Machine, state: State, connection: Connection) -> Latency | None:
    """Latency of a connection; 0 for a source of `machine`. None if the state does not run the source: the value is
    then from another state or from the start of the machine."""
    if connection.source.instance < 0:
        return Latency(0, 0)
    by_instance = {e.instance: e for e in state.entries}
    source, target = by_instance.get(connection.source.instance), by_instance[connection.target.instance]
    return latency(source, target, connection.delayed) if source is not None else None
