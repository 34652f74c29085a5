# SPDX-License-Identifier: Apache-2.0
"""When the instances of a state are due, and how old a value is when it is used."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..model.machine import Connection, Entry, Machine, State

#: Sets of entries that are due together; with more, there is no list of them.
MOST_SLOTS = 256
#: No machine reaches this tick.
NEVER = 1 << 62


@dataclass(frozen=True)
class Slot:
    """Ticks of the major cycle at which the same entries are due: how many, the first of them, and positions of entries."""

    ticks: int
    first: int
    due: tuple[int, ...]


@dataclass(frozen=True)
class Latency:
    """Ticks from the execute that computed a value to the one that uses it, over the major cycle, once both have run."""

    least: int
    most: int


def major_cycle(entries: Iterable[Entry]) -> int:
    """Ticks after which the pattern of due instances repeats."""
    return math.lcm(*(e.divisor for e in entries))


def slots(entries: Sequence[Entry]) -> list[Slot] | None:
    """In the order of their first ticks; without those that no machine lives to see. None when there are more than MOST_SLOTS."""
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
    """Where entries meet, as (first tick, period): the ticks at which all of some entries are due are all that are congruent to one
    of them modulo their divisors' least common multiple, or none (Chinese remainder theorem). None: too many."""
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
    """Of a connection between two entries of one state. A source that is not delayed stands before its target in the
    state's order, so where both are due it passes on what it made in the same tick; a delayed one gives what was there
    when the tick began.

    The source last ran r ticks ago with r = (tick - its phase) mod its divisor; the target's ticks meet exactly the r that
    are congruent modulo the divisors' greatest common one.
    """
    common = math.gcd(source.divisor, target.divisor)
    least = (target.phase - source.phase - delayed) % common
    return Latency(least + delayed, source.divisor - common + least + delayed)


def latency_of(machine: Machine, state: State, connection: Connection) -> Latency | None:
    """0 for what `machine` itself offers. None where the state does not run the source: the value is what another state,
    or the machine's start, left."""
    if connection.source.instance < 0:
        return Latency(0, 0)
    by_instance = {e.instance: e for e in state.entries}
    source, target = by_instance.get(connection.source.instance), by_instance[connection.target.instance]
    return latency(source, target, connection.delayed) if source is not None else None
