# SPDX-License-Identifier: Apache-2.0
"""Finds phases that distribute the load of a state evenly over the ticks of its major cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..model.machine import Entry
from .schedule_facts import major_cycle

#: Maximum length of a cycle in ticks.
MOST_TICKS = 50_000
#: Minimum relative reduction of the peak that is reported.
_WORTHWHILE = 0.1
#: Maximum number of rounds of improvement. Each lowers the peak or leaves it equal; later rounds change little.
_ROUNDS = 8


def load_per_tick(entries: Sequence[Entry], costs: Sequence[int]) -> list[int]:
    """Sum of the costs of the due entries, for each tick of the major cycle."""
    load = [0] * major_cycle(entries)
    for entry, cost in zip(entries, costs, strict=True):
        for tick in range(entry.phase, len(load), entry.divisor):
            load[tick] += cost
    return load


def levelled(entries: Sequence[Entry], costs: Sequence[int]) -> tuple[Entry, ...] | None:
    """The same entries with phases that lower the peak by at least a tenth. None if none are found or the cycle is too
    long.

    The costliest entries choose first, each the phase with the lowest peak. Then every entry chooses again, as long as
    the peak falls. At equal peaks the given phase has preference, then the tick with the lower load, then the smaller
    phase. The method is greedy and deterministic. It does not always find the optimum, but the result is never worse
    than the input.
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
    """Reverts every change that the lower peak does not need."""
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

    # The peak elsewhere does not depend on this entry's phase; only the ticks at which it is due matter.
    chosen[n] = replace(entry, phase=min(range(entry.divisor), key=rank))
    _add(load, chosen[n], cost)


def _add(load: list[int], entry: Entry, cost: int) -> None:
    for tick in range(entry.phase, len(load), entry.divisor):
        load[tick] += cost
