# SPDX-License-Identifier: Apache-2.0
"""Ticks from the beginning of a flight: the bounded model checking."""

from __future__ import annotations

from ..model.types import BOOL
from .invariants import Invariant
from .progress import Progress
from .properties import Property
from .solver import TimeUp
from .terms import Value
from .tick import Inputs
from .watched import Moment


class Base:
    """Stands after the ticks that were made."""

    def __init__(self, progress: Progress, begin: Moment):
        self.p, self.moment, self.solver = progress, begin, progress.solver()
        self.inputs: list[Inputs] = []

    def advance(self, properties: list[Property], invariants: list[Invariant]) -> list[Invariant]:
        """One more tick: refutes properties; returns the invariants that hold in it."""
        progress, solver = self.p, self.solver
        progress.check_time()
        inputs, legal = progress.terms.machine.inputs()
        self.inputs.append(inputs)
        self.moment = progress.terms.step(self.moment, inputs)
        for condition in [*legal, progress.terms.assumed(self.moment)]:
            solver.require(condition)
        wrong = {p: progress.terms.violated(p, self.moment) for p in properties}
        for p in properties:
            if p in progress.open() and self._can_be(p, wrong[p]):
                progress.unclear |= {p} - set(progress.try_flight(properties, progress.given(solver, self.inputs)))
        fails = {i: progress.t.negation(i.holds(progress.terms, self.moment)) for i in invariants}
        while invariants and solver.may_hold([progress.t.any_of(fails[i] for i in invariants)]):
            invariants = [i for i in invariants if not solver.value(fails[i], BOOL)]
        for p in progress.open():
            solver.require(progress.t.negation(wrong[p]))
        return invariants

    def _can_be(self, p: Property, wrong: Value) -> bool:
        """Whether a property can be violated. One that takes too long stays open."""
        try:
            return self.solver.can_hold([wrong], self.p.slice())
        except TimeUp:
            self.p.unclear.add(p)
            return False
