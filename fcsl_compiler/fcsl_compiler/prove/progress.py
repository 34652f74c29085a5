# SPDX-License-Identifier: Apache-2.0
"""What is known of the properties of a machine while they are searched, and what all questions share."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from ..model.types import BOOL
from .invariants import Invariant
from .operations import Operations
from .properties import Property
from .solver import Solver, TimeUp
from .terms import Terms, Value
from .tick import Inputs
from .watched import Given, Moment, Watched, WatchedTerms


class Answer(StrEnum):
    PROVEN = "proven"
    REFUTED = "refuted"
    OPEN = "open"


@dataclass
class Finding:
    """`depth`: ticks from the beginning that were shown to be free of violations. `induction`: ticks of the induction that
    proved it. `flight`: inputs of each tick up to the violation."""

    property: Property
    answer: Answer = Answer.OPEN
    depth: int = 0
    induction: int = 0
    flight: list[Given] = field(default_factory=list)


#: Something that is to hold in every tick.
Claim = Property | Invariant


class Progress:
    """`deadline`: of time.process_time(). `exact`: of the solvers. `unclear`: properties that got no answer at this
    exactness; they are not asked again. `slow`: of those the induction is not."""

    def __init__(self, watched: Watched, wanted: Iterable[Property], deadline: float):
        self.w, self.deadline = watched, deadline
        self.findings = {p: Finding(p) for p in wanted}
        self.operations = Operations(Terms())
        self.terms = WatchedTerms(watched, self.operations)
        self.t = self.terms.t
        self.exact = False
        self.unclear: set[Property] = set()
        self.slow: set[Property] = set()
        self.proven: list[Claim] = []

    def solver(self) -> Solver:
        return Solver(self.operations, self.deadline, self.exact)

    def open(self) -> list[Property]:
        return [p for p, f in self.findings.items() if f.answer is Answer.OPEN and p not in self.unclear]

    @property
    def opaque(self) -> dict[str, str]:
        """Instances that were not looked into, and why."""
        return {self.w.machine.instances[i].name: why for i, why in self.terms.machine.opaque.items()}

    # ---- time -------------------------------------------------------------------------------------------------------

    def check_time(self) -> None:
        """Raises TimeUp."""
        if self.left() < 0.0:
            raise TimeUp

    def left(self) -> float:
        """Seconds."""
        return self.deadline - time.process_time()

    def slice(self) -> float:
        """Seconds for one simple question: so that each of several about all open properties can be asked."""
        return max(0.5, self.left() / (8 * (1 + len(self.open()))))

    # ---- answers ----------------------------------------------------------------------------------------------------

    def prove(self, claim: Claim, ticks: int) -> None:
        """By an induction over so many ticks."""
        self.proven.append(claim)
        if isinstance(claim, Property):
            self.findings[claim].answer, self.findings[claim].induction = Answer.PROVEN, ticks

    def refute(self, p: Property, flight: list[Given]) -> None:
        self.findings[p].answer, self.findings[p].flight = Answer.REFUTED, flight

    def try_flight(self, properties: Iterable[Property], flight: list[Given]) -> list[Property]:
        """Those that a flight violates in its last tick, in CPython: they are refuted."""
        self.w.begin()
        for given in flight:
            self.w.tick(given)
        found = [p for p in properties if self.w.is_violated(p)]
        for p in found:
            self.refute(p, flight)
        return found

    def violated(self, claim: Claim, moment: Moment) -> Value:
        if isinstance(claim, Property):
            return self.terms.violated(claim, moment)
        return self.t.negation(claim.holds(self.terms, moment))

    def given(self, solver: Solver, inputs: Sequence[Inputs]) -> list[Given]:
        """The inputs of the case that a solver found."""
        types = self.terms.machine.types
        return [
            (
                {name: solver.value(came, BOOL) for name, came in one.samples.items()},
                {path: [solver.value(v, types[path]) for v in values] for path, values in one.values.items()},
            )
            for one in inputs
        ]
