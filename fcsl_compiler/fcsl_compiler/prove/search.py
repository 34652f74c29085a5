# SPDX-License-Identifier: Apache-2.0
"""Bounded model checking and k-induction of all properties of a machine at once.

From the beginning, tick by tick, each property is refuted by inputs that violate it in tick t, or holds in all ticks up to
t. Then from any state at all: if properties that hold in k ticks in a row cannot be violated in the next one, they hold
always. Invariants that flights suggest (invariants.py) are tried with them, for most properties need some.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from .base import Base
from .invariants import Invariant, suggest
from .progress import Progress
from .properties import Property
from .solver import TimeUp
from .step import Step
from .watched import Moment, Watched

#: Part of the time for flights on random inputs.
_FLIGHTS = 0.25
#: Lengths of inductions, ticks.
_INDUCTIONS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)


def search(
    watched: Watched, wanted: Sequence[Property], seconds: float, depth: int, tell: Callable[[str], None]
) -> Progress:
    """Answers about the wanted properties, in so many seconds of computing for all of them. `depth`: most ticks from the
    beginning. `tell` gets a line about what is going on."""
    progress = Progress(watched, wanted, time.process_time() + seconds)
    try:
        watched.begin()
        begin = progress.terms.beginning()
        _pass(progress, begin, [], 1, tell)  # much needs no more
        progress.unclear, progress.slow = set(), set()
        if not progress.open():
            return progress
        invariants, violated = suggest(watched, progress.open(), time.process_time() + _FLIGHTS * progress.left())
        for p, flight in violated.items():
            progress.refute(p, flight)
        for progress.exact in (False, True):
            _pass(progress, begin, invariants, depth, tell)
            progress.unclear, progress.slow = set(), set()
    except TimeUp:
        tell("no time is left")
    return progress


def _pass(
    progress: Progress, begin: Moment, invariants: list[Invariant], depth: int, tell: Callable[[str], None]
) -> None:
    base = Base(progress, begin)
    for ticks in range(1, depth + 1):
        if not progress.open():
            return
        tell(f"tick {ticks}: {len(progress.open())} of {len(progress.findings)} are open")
        invariants = base.advance(progress.open(), invariants)
        for p in progress.open():
            progress.findings[p].depth = max(ticks, progress.findings[p].depth)
        if ticks in _INDUCTIONS and progress.open():
            for claim in Step(progress, begin, ticks).proven(progress.open(), invariants):
                progress.prove(claim, ticks)
            invariants = [i for i in invariants if i not in progress.proven]
