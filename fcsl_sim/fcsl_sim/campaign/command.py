# SPDX-License-Identifier: Apache-2.0
"""`fcsl campaign`: flies a study, or one of its cases."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..errors import SimError
from ..output import show
from ..watchdog import Watchdog
from . import report
from .engine import open_engine
from .flight import Flight, Flights, Outcome
from .progress import Progress
from .requirements import requirements
from .results import Results
from .study import Study, read_study

EXIT_FAILED = 1
_SUFFIXES = (".study.json", ".json")


def run_campaign(options: Any) -> int:
    """Exit status: 0 if every case passed, else 1. Raises SimError or DiagnosticError."""
    study = read_study(options.study, options.cases, options.parameters)
    for warning in study.config.warnings:
        print(warning, file=sys.stderr)
    if options.case is not None:
        return _fly_one(study, options)
    if options.record is not None:
        raise SimError("`--record` is for one case: give `--case` too")
    if find_spec("pyarrow") is None:  # not when hours have been flown
        raise SimError("the table of a campaign needs the Python package `pyarrow`: python3 -m pip install pyarrow")
    results = Results(study, options.output or _folder(options.study), options.restart)
    for line in results.damage:
        print(f"fcsl-sim: warning: {line}", file=sys.stderr)
    if results.done:
        print(f"{results.folder}: {results.done} of {study.cases} cases are there already", file=sys.stderr)
    _fly_missing(study, results, options)
    table, page = results.write_table(), report.write_page(results)
    if options.json:
        show(json.dumps(_summary(results, table, page), indent=2))
    else:
        print(report.text(results))
        print(f"{table}\n{page}")
    return 0 if results.count("passed") == study.cases else EXIT_FAILED


def _folder(study: Path) -> Path:
    """Beside the user, not beside the file: `touchdown.study.json` gives `touchdown.campaign`."""
    suffix = next((s for s in _SUFFIXES if study.name.endswith(s)), "")
    return Path(study.name.removesuffix(suffix) + ".campaign")


def _fly_missing(study: Study, results: Results, options: Any) -> None:
    jobs = min(options.jobs or len(os.sched_getaffinity(0)), max(1, study.cases - results.done))
    if results.done == study.cases:
        return
    progress = Progress(partial(_progress, results, results.done))
    with open_engine(options.engine, study, jobs, options.cases) as engine:
        for _, outcome in engine.fly(map(Flight, results.missing()), progress.show):
            results.add(outcome)
    progress.end()


def _fly_one(study: Study, options: Any) -> int:
    if not 0 <= options.case < study.cases:
        raise SimError(f"there is no case {options.case}: the study has cases 0 to {study.cases - 1}")
    if options.record is not None and options.record.exists():
        raise SimError(f"{options.record}: exists already; a bag is written into a new directory")
    flights = Flights(study)
    with Watchdog(options.json) as watchdog:
        outcome = flights.fly(options.case, options.record, watchdog)
    flights.close()
    if options.json:
        names = {"values": [p.path for p in study.parameters], "metrics": study.columns}
        found = asdict(outcome)
        for key, keys in names.items():
            found[key] = dict(zip(keys, found[key], strict=True))
        show(json.dumps(found, indent=2))
    else:
        print(_lines(study, outcome))
    return 0 if outcome.verdict == "passed" else EXIT_FAILED


def _lines(study: Study, outcome: Outcome) -> str:
    lines = [f"case {outcome.case} {outcome.verdict}, seed {outcome.seed}"]
    lines += [f"  {p.path} = {value}" for p, value in zip(study.parameters, outcome.values, strict=True)]
    if outcome.error:
        return "\n".join([*lines, outcome.error])
    if outcome.failed_by:
        lines[0] += f": {outcome.failed_by}"
    lines += [f"  {name} = {value:.9g}" for name, value in zip(study.columns, outcome.metrics, strict=True)]
    return "\n".join([*lines, f"{outcome.ticks} ticks, hash {outcome.hash}"])


def _summary(results: Results, table: Path, page: Path) -> dict[str, Any]:
    passed, cases = results.count("passed"), results.study.cases
    return {
        "study": str(results.study.path),
        "cases": cases,
        "passed": passed,
        "failed": results.count("failed"),
        "errors": results.count("error"),
        "confidence_95": report.wilson(passed, cases),
        "requirements": [asdict(line) for line in requirements(results)],
        "table": str(table),
        "report": str(page),
    }


def _progress(results: Results, first: int, seconds: float) -> str:
    """`first`: cases that were there before."""
    done, cases = results.done, results.study.cases
    rate = (done - first) / seconds
    left = f", {(cases - done) / rate:.0f} s left" if rate > 0 and done < cases else ""
    failed = results.count("failed") + results.count("error")
    return f"{done} of {cases} cases, {failed} not passed, {rate:.3g} a second{left}"
