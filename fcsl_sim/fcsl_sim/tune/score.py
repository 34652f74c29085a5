# SPDX-License-Identifier: Apache-2.0
"""How good a candidate is: by how much its flights miss what they shall, and what they cost.

Of two candidates the better one misses less; of two that miss nothing the one of less cost. This is the rule of K. Deb,
Computer Methods in Applied Mechanics and Engineering 186 (2000) 311.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..campaign.flight import Outcome
from ..campaign.requirements import judge_lines
from ..campaign.study import Study

#: Of a candidate that misses something; more than any cost.
_FAR = 1e100
#: Of what just does not hold: `x < 2` at 2.
_LEAST = 1e-9


@dataclass(frozen=True)
class Score:
    """`missed` is 0 for flights that all pass; `cost` the mean of `minimise` over the flights, infinite if one has none."""

    missed: float
    cost: float

    @property
    def energy(self) -> float:
        """Both as one number, in the same order."""
        return self.cost if self.missed == 0.0 else _FAR * self.missed

    def __str__(self) -> str:
        return f"{self.cost:.6g}" if self.missed == 0.0 else f"not passed, misses {self.missed:.3g}"


def score(study: Study, outcomes: Sequence[Outcome]) -> Score:
    """Of the flights of a candidate. Each line of `pass` that does not hold misses its distance as part of both sides, or 1; each
    requirement of the machine the part of ticks in which it is violated; a flight with an error more than all of them."""
    assert study.tune
    table = np.array([outcome.metrics for outcome in outcomes], dtype=np.float64).reshape(len(outcomes), -1)
    numbers = {name: table[:, i] for i, name in enumerate(study.columns)}
    missed = np.zeros(len(outcomes))
    lines = judge_lines(study, numbers, len(outcomes))
    for line in lines:
        if line.holds is not None:
            part = np.ones(len(outcomes))
            if line.margins is not None and line.sizes is not None:
                with np.errstate(invalid="ignore", divide="ignore"):
                    part = np.abs(line.margins) / line.sizes
            part = np.where(np.isfinite(part), np.maximum(part, _LEAST), 1.0)
            missed += np.where(line.holds, 0.0, part)
    ticks = np.array([max(1, outcome.ticks) for outcome in outcomes])
    required = [verdict.id for verdict in study.required.values() if not verdict.assumed]
    for id_ in required:
        missed += np.minimum(1.0, np.nan_to_num(numbers[f"requirement.{id_}"]) / ticks)
    costs = [_cost(study, outcome) for outcome in outcomes]
    for i, outcome in enumerate(outcomes):
        if outcome.verdict == "error":
            missed[i] = len(lines) + len(required) + 1.0
        elif not math.isfinite(costs[i]) or (outcome.verdict == "failed" and missed[i] == 0.0):
            missed[i] += 1.0
    return Score(math.fsum(missed) / len(outcomes), math.fsum(costs) / len(outcomes) if outcomes else math.inf)


def _cost(study: Study, outcome: Outcome) -> float:
    assert study.tune
    found = float(
        study.tune.minimise.part(study.tune.minimise.root, {}, dict(zip(study.metrics, outcome.metrics, strict=False)))
    )
    return found if outcome.verdict != "error" and math.isfinite(found) else math.inf
