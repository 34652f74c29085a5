# SPDX-License-Identifier: Apache-2.0
"""`fcsl tune`: finds parameters of controllers, judges them by other cases than those that it tuned to, and writes them."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..campaign.case_rows import written_whole
from ..campaign.engine import Engine, open_engine
from ..campaign.flight import Flight, Flights, Outcome
from ..campaign.progress import Progress
from ..campaign.report import wilson
from ..campaign.study import Study, read_study
from ..errors import SimError
from ..output import show
from .parameter_file import parameter_file
from .picture import draw
from .score import Score, score
from .search import Search
from .trial_log import TrialLog

EXIT_NOT_PASSED = 1
PARAMETERS, PICTURE, RESULT = "parameters.yaml", "tune.png", "result.json"
#: Of cases that did not pass.
_NAMED = 5
_SUFFIXES = (".study.json", ".json")


def run_tune(options: Any) -> int:
    """Exit status: 0 if every case that has not tuned passes with the result, else 1. Raises SimError, TwinError or
    DiagnosticError."""
    study = read_study(options.study, parameters=options.parameters)
    if study.tune is None:
        fix = 'add "tune": {"parameters": …, "minimise": …, "cases": …} (docs/guide/campaigns.md)'
        raise SimError(f"{options.study}: the study has no `tune`: {fix}")
    for warning in study.config.warnings:
        print(warning, file=sys.stderr)
    flights = Flights(study)
    folder = options.output or _folder(options.study)
    log = TrialLog(folder, _fingerprint(study), options.restart)
    if log.damaged:
        print(f"fcsl-sim: warning: {log.path}: {log.damaged} lines damaged, so flown again", file=sys.stderr)
    if log.trials:
        print(f"{folder}: {len(log.trials)} candidates are there already", file=sys.stderr)
    try:
        with open_engine(options.engine, study, options.jobs or len(os.sched_getaffinity(0))) as engine:
            search = Search(study, engine, log, flights.own_gains())
            progress = Progress(partial(_progress, search))
            search.run(progress.show)
            progress.end()
            before, after = (_judged(study, engine, gains) for gains in ((), search.best.candidate))
    finally:
        log.close()
    with written_whole(folder / PARAMETERS) as path:
        path.write_text(parameter_file(flights, search.best.candidate), encoding="utf-8")
    draw(folder / PICTURE, flights, search.generations, search.before, search.best)
    flights.close()
    result = _result(study, search, before, after, folder)
    with written_whole(folder / RESULT) as path:
        path.write_text(json.dumps(result, indent=2) + "\n")
    show(json.dumps(result, indent=2) if options.json else _text(study, search, before, after, folder))
    return 0 if after.passed == len(after.outcomes) else EXIT_NOT_PASSED


def _folder(study: Path) -> Path:
    suffix = next((s for s in _SUFFIXES if study.name.endswith(s)), "")
    return Path(study.name.removesuffix(suffix) + ".tune")


def _fingerprint(study: Study) -> str:
    """Another scipy may ask for other candidates."""
    import scipy

    return f"{study.fingerprint} scipy {scipy.__version__}"


@dataclass(frozen=True)
class _Judged:
    """Flights of the cases that have not tuned."""

    outcomes: Sequence[Outcome]
    score: Score

    @property
    def passed(self) -> int:
        return sum(outcome.verdict == "passed" for outcome in self.outcomes)

    def medians(self, study: Study) -> dict[str, float | None]:
        found: dict[str, float | None] = {}
        for i, name in enumerate(study.metrics):
            values = np.array([outcome.metrics[i] for outcome in self.outcomes])
            values = values[np.isfinite(values)]
            found[name] = float(np.median(values)) if len(values) else None
        return found


def _judged(study: Study, engine: Engine, gains: tuple[float, ...]) -> _Judged:
    assert study.tune
    flights = [Flight(case, gains) for case in range(study.tune.cases, study.cases)]
    found = {flight.case: outcome for flight, outcome in engine.fly(flights, lambda: None)}
    outcomes = [found[flight.case] for flight in flights]
    return _Judged(outcomes, score(study, outcomes))


def _result(study: Study, search: Search, before: _Judged, after: _Judged, folder: Path) -> dict[str, Any]:
    assert study.tune

    def judged(one: _Judged) -> dict[str, Any]:
        cost = one.score.cost if np.isfinite(one.score.cost) else None
        return {"passed": one.passed, "cost": cost, "medians": one.medians(study)}

    pairs = zip(study.tune.parameters, search.own, search.best.candidate, strict=True)
    return {
        "study": str(study.path),
        "parameters": {p.path: {"before": old, "after": new, "unit": p.field.unit} for p, old, new in pairs},
        "generations": len(search.generations),
        "candidates": len(search.log.trials),
        "judged_cases": [study.tune.cases, study.cases - 1],
        "before": judged(before),
        "after": judged(after) | {"confidence_95": wilson(after.passed, len(after.outcomes))},
        "parameter_file": str(folder / PARAMETERS),
        "picture": str(folder / PICTURE),
    }


def _text(study: Study, search: Search, before: _Judged, after: _Judged, folder: Path) -> str:
    tune = study.tune
    assert tune
    count, first, last = len(after.outcomes), tune.cases, study.cases - 1
    lines = [
        f"{len(search.log.trials)} candidates in {len(search.generations)} generations, each flown in cases 0 to {first - 1}: "
        f"`{tune.minimise.text}` {search.best.score}, before {search.before.score}"
    ]
    width = max(len(p.path) for p in tune.parameters)
    for p, old, new in zip(tune.parameters, search.own, search.best.candidate, strict=True):
        at_end = ", at its bound" if new in (p.low, p.high) else ""
        unit = f" {p.field.unit}" if p.field.unit else ""
        lines.append(f"  {p.path.ljust(width)}  {old:g} -> {new:g}{unit}{at_end}")
    low, high = (100 * share for share in wilson(after.passed, count))
    lines.append(
        f"cases {first} to {last}, which have not tuned: {after.passed} of {count} passed, before {before.passed}: "
        f"{100 * after.passed / count:.4g} %, with 95 % confidence within {low:.4g} and {high:.4g} %"
    )
    lines.append(f"  `{tune.minimise.text}` {after.score}, before {before.score}")
    old_medians, new_medians = before.medians(study), after.medians(study)
    for name, metric in study.metrics.items():
        old_text, new_text = (_number(medians[name]) for medians in (old_medians, new_medians))
        lines.append(f"  {name}: median {new_text}, before {old_text}" + (f", {metric.unit}" if metric.unit else ""))
    failed = [outcome for outcome in after.outcomes if outcome.verdict != "passed"]
    lines += [f"case {o.case} {o.verdict}: {o.error or o.failed_by}" for o in failed[:_NAMED]]
    return "\n".join([*lines, str(folder / PARAMETERS), str(folder / PICTURE)])


def _number(value: float | None) -> str:
    return "never a number" if value is None else f"{value:.5g}"


def _progress(search: Search, seconds: float) -> str:
    if not search.generations:
        return ""
    tune, done = search.tune, len(search.generations)
    rate = search.flown / seconds
    left = (tune.generations + 1 - done) * tune.population * tune.cases / rate if rate > 0 else 0.0
    return (
        f"generation {done} of {tune.generations + 1}, {len(search.log.trials)} candidates, best {search.best_score()}, "
        f"{rate:.3g} flights a second, {left:.0f} s left at most"
    )
