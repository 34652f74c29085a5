# SPDX-License-Identifier: Apache-2.0
"""The search: differential evolution (R. Storn, K. Price, Journal of Global Optimization 11 (1997) 341) as scipy has it, generation
by generation, with the flights of a generation on all cores."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..campaign.engine import Engine
from ..campaign.flight import Flight, Outcome
from ..campaign.study import Study
from .score import Score, score
from .trial_log import Candidate, Trial, TrialLog

#: Of gains.
_DIGITS = 6

Array = np.ndarray[Any, Any]


class Search:
    """`before` is the trial of the machine's own values; `generations` are the trials of each generation. `flown` counts flights of
    this process."""

    def __init__(self, study: Study, engine: Engine, log: TrialLog, own: Sequence[float]):
        assert study.tune
        self.study, self.tune, self.engine, self.log = study, study.tune, engine, log
        self.own = tuple(own)
        self.generations: list[list[Trial]] = []
        self.flown = 0

    def run(self, progress: Callable[[], None]) -> None:
        """`best` is the trial that is best; of equal ones the first. `progress` is called while flights are flown."""
        self._progress = progress
        from scipy.optimize import differential_evolution
        from scipy.stats import qmc

        (self.before,) = self._fly([self.own])
        bounds = [(p.low, p.high) for p in self.tune.parameters]
        low, high = np.array(bounds).T
        seed = self.study.seed % 2**63
        first = low + (high - low) * qmc.LatinHypercube(len(bounds), rng=seed).random(self.tune.population)
        if all(a <= value <= b for (a, b), value in zip(bounds, self.own, strict=True)):
            first[0] = self.own
        differential_evolution(
            self._generation,
            bounds,
            init=first,
            maxiter=self.tune.generations,
            rng=seed,
            tol=0.0,  # all generations: how far the costs differ says little about the gains
            polish=False,
            updating="deferred",
            vectorized=True,
        )
        every = [trial for trials in self.generations for trial in trials]
        self.best = min(every, key=lambda trial: trial.score.energy)

    def best_score(self) -> Score:
        """So far."""
        scores = [trial.score for trials in self.generations for trial in trials] or [Score(math.inf, math.inf)]
        return min(scores, key=lambda score: score.energy)

    def _generation(self, population: Array) -> Array:
        """The energies of candidates, which are columns."""
        trials = self._fly([self._candidate(column) for column in np.atleast_2d(population.T)])
        self.generations.append(trials)
        return np.array([trial.score.energy for trial in trials])

    def _candidate(self, values: Array) -> Candidate:
        """With few digits, as a person writes gains, and within the bounds, from which scipy strays by roundings."""
        pairs = zip(values, self.tune.parameters, strict=True)
        return tuple(min(max(float(f"{value:.{_DIGITS}g}"), p.low), p.high) for value, p in pairs)

    def _fly(self, candidates: Sequence[Candidate]) -> list[Trial]:
        """Those that were not flown yet are, and then kept."""
        missing = dict.fromkeys(c for c in candidates if c not in self.log.trials)
        outcomes: dict[Candidate, dict[int, Outcome]] = {candidate: {} for candidate in missing}
        flights = [Flight(case, candidate) for candidate in missing for case in range(self.tune.cases)]
        for flight, outcome in self.engine.fly(flights, self._progress) if flights else ():
            self.flown += 1
            found = outcomes[flight.gains]
            found[flight.case] = outcome
            if len(found) == self.tune.cases:
                self.log.add(flight.gains, score(self.study, [found[case] for case in range(self.tune.cases)]))
        return [self.log.trials[candidate] for candidate in candidates]
