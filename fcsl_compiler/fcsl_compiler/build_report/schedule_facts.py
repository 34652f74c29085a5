# SPDX-License-Identifier: Apache-2.0
"""When the instances of a state are due, and how old a value is when it is used."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..machine import Connection, Entry, Machine, State

#: Ticks of the longest cycle that is gone through; a longer one has no list of slots.
MOST_TICKS = 50_000


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
    """In the order of their first ticks. None when the cycle is longer than MOST_TICKS."""
    cycle = major_cycle(entries)
    if cycle > MOST_TICKS:
        return None
    due: list[list[int]] = [[] for _ in range(cycle)]
    for n, entry in enumerate(entries):
        for tick in range(entry.phase, cycle, entry.divisor):
            due[tick].append(n)
    found: dict[tuple[int, ...], list[int]] = {}
    for tick, positions in enumerate(due):
        found.setdefault(tuple(positions), []).append(tick)
    return [Slot(len(ticks), ticks[0], positions) for positions, ticks in found.items()]


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
