# SPDX-License-Identifier: Apache-2.0
"""Phases that spread the load of a state evenly over the ticks of its major cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..model.machine import Entry
from .schedule_facts import major_cycle

#: Ticks of the longest cycle that is levelled.
MOST_TICKS = 50_000
#: Of the peak: what new phases must take off to be worth a word.
_WORTHWHILE = 0.1
#: Rounds in which every entry may move once more; each makes the peak no larger, and few change anything.
_ROUNDS = 8


def load_per_tick(entries: Sequence[Entry], costs: Sequence[int]) -> list[int]:
    """Sum of the costs of what is due, for each tick of the major cycle."""
    load = [0] * major_cycle(entries)
    for entry, cost in zip(entries, costs, strict=True):
        for tick in range(entry.phase, len(load), entry.divisor):
            load[tick] += cost
    return load


def levelled(entries: Sequence[Entry], costs: Sequence[int]) -> tuple[Entry, ...] | None:
    """The same entries with phases of a peak that is lower by a tenth or more, or None where this finds none (or the cycle is too
    long to look).

    First the costliest entries choose, each the phase at which the peak is lowest; then every entry chooses anew among the
    others, as long as that lowers something. At equal peaks the phase that is there stays, then the emptier one, then the
    smaller. Greedy, so not always the best; the same every time; never worse than what is there.
    """
    if major_cycle(entries) > MOST_TICKS:
        return None
    before = load_per_tick(entries, costs)
    if max(before) == 0:
        return None
    load = [0] * len(before)
    chosen: list[Entry] = list(entries)
    order = sorted(range(len(entries)), key=lambda n: -costs[n])
    for n in order:
        _place(chosen, n, costs[n], load)
    for _ in range(_ROUNDS):
        phases = [e.phase for e in chosen]
        for n in order:
            _add(load, chosen[n], -costs[n])
            _place(chosen, n, costs[n], load)
        if phases == [e.phase for e in chosen]:
            break
    if max(load) > (1 - _WORTHWHILE) * max(before):
        return None
    return tuple(_kept(entries, chosen, costs, max(load)))


def _kept(entries: Sequence[Entry], chosen: list[Entry], costs: Sequence[int], peak: int) -> list[Entry]:
    """Takes back every move that the lower peak does not need."""
    for n, entry in enumerate(entries):
        trial = [*chosen[:n], entry, *chosen[n + 1 :]]
        if max(load_per_tick(trial, costs)) <= peak:
            chosen = trial
    return chosen


def _place(chosen: list[Entry], n: int, cost: int, load: list[int]) -> None:
    entry = chosen[n]

    def rank(phase: int) -> tuple[int, bool, int, int]:
        there = load[phase :: entry.divisor]
        return max(there), phase != entry.phase, sum(there), phase

    # The peak elsewhere does not depend on this entry's phase, so what it meets decides.
    chosen[n] = replace(entry, phase=min(range(entry.divisor), key=rank))
    _add(load, chosen[n], cost)


def _add(load: list[int], entry: Entry, cost: int) -> None:
    for tick in range(entry.phase, len(load), entry.divisor):
        load[tick] += cost
