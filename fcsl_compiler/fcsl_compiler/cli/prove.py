# SPDX-License-Identifier: Apache-2.0
"""`fcsl prove`: which requirements and assertions of a machine hold for all inputs, and which states it can reach."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.diagnostics import nearest
from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..driver.externs import build_externs
from ..driver.monitors import compile_monitor
from ..driver.passes import Compilation, compile_machine
from ..emit.field_table import source_hash
from ..reference.externs import externs_of

if TYPE_CHECKING:
    from ..prove.progress import Finding, Progress
    from ..prove.properties import Property
    from ..prove.watched import Watched

#: What a state says that other properties call refuted and proven.
_OF_STATES = {"refuted": "reached", "proven": "unreachable", "open": "open"}


def run(options: argparse.Namespace) -> int:
    if options.seconds <= 0 or options.depth < 1:
        raise UsageError("--seconds and --depth are positive")
    try:
        import bitwuzla  # noqa: F401
    except ImportError:
        raise UsageError(
            "it needs the package bitwuzla: python3 -m pip install bitwuzla; the wheel's extra `fcsl[all]` brings it"
        ) from None
    from ..prove.flight import StartFaulted
    from ..prove.search import search
    from ..prove.watched import Watched

    compiled = compile_machine(options.config, "", until="lower", requirements=options.requirements)
    compile_monitor(compiled, until="lower")
    try:
        externs = externs_of(build_externs(options.config)) if compiled.checked.externs else None
        watched = Watched(compiled, externs)
    except StartFaulted as error:
        raise UsageError(f"{options.config}: `start` of `{error.args[0]}` faults: the machine does not begin") from None
    progress = search(watched, _wanted(watched, options.only), options.seconds, options.depth, _tell)
    findings = list(progress.findings.values())
    tests = _write_tests(watched, findings, options)
    document = _document(compiled, progress, findings, tests)
    if options.format == "json":
        print(json.dumps(document, indent=1))
    else:
        print(_text(compiled, progress, findings, tests), end="")
    return 1 if any(f.answer == "refuted" and f.property.kind != "state" for f in findings) else 0


def _tell(line: str) -> None:
    if sys.stderr.isatty():
        print(f"fcsl prove: {line}", file=sys.stderr, flush=True)


def _wanted(watched: Watched, only: Sequence[str]) -> list[Property]:
    from ..prove.properties import properties_of

    every = list(properties_of(watched.machine, watched.requirements))
    known = [p.id for p in every]
    if not known:
        raise UsageError(f"nothing to prove: `{watched.machine.name}` has no requirement, no assertion and one state")
    others = {r.id: "an assumption" if r.assumed else "judged by the last tick alone" for r in watched.requirements}
    for name in only:
        if name not in known and name in others:
            raise UsageError(f"`{name}` is {others[name]}: there is nothing to prove in every tick")
        if name not in known:
            hint = nearest(name, known) or f"there are {', '.join(known) or 'none'}"
            raise UsageError(f"`{name}` is no requirement that ticks can violate, no assertion and no state; {hint}")
    return [p for p in every if not only or p.id in only]


def _write_tests(watched: Watched, findings: Sequence[Finding], options: argparse.Namespace) -> dict[str, Path]:
    """Writes a test for each refuted requirement and assertion. Returns them by id."""
    from ..prove.counterexample import simplified, test_of

    written: dict[str, Path] = {}
    for finding in findings:
        if finding.answer != "refuted" or finding.property.kind == "state":
            continue
        finding.flight = simplified(watched, finding.property, finding.flight)
        if options.output is None:
            continue
        text = test_of(watched, finding.property, finding.flight, options.config)
        if text:
            path = options.output / f"test_{re.sub(r'[^a-z0-9]+', '_', finding.property.id.lower()).strip('_')}.py"
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, text)
            written[finding.property.id] = path
    return written


def _assumptions(compiled: Compilation, progress: Progress) -> list[str]:
    """What all answers rest on."""
    machine = compiled.checked
    found = [
        "parameters have the values of the machine JSON; other fields that hosts write have any values in each tick",
        "sensors are attached; a sample arrives in its tick, or not at all; nothing is injected",
    ]
    found += [f"{r.id}: {r.text}" for r in compiled.requirements if r.assumed]
    if any(i.max_wcet_us for i in machine.instances):
        found.append("no run is longer than its max_wcet_us")
    if any(a.effects for a in machine.algorithms):
        found.append("hardware and externs return any values")
    found += [f"`{name}` makes any outputs: {why}" for name, why in progress.opaque.items()]
    return found


def _method(finding: Finding) -> str:
    if finding.answer == "proven":
        return f"induction over {finding.induction} tick{'' if finding.induction == 1 else 's'}"
    if finding.answer == "refuted":
        return f"in tick {len(finding.flight) - 1}"
    return f"not in the first {finding.depth} ticks" if finding.depth else "no answer in time"


def _document(
    compiled: Compilation, progress: Progress, findings: Sequence[Finding], tests: dict[str, Path]
) -> dict[str, object]:
    assumptions = _assumptions(compiled, progress)
    rows = [
        {
            "kind": f.property.kind,
            "id": f.property.id,
            "text": f.property.text,
            "answer": str(f.answer),
            "method": "induction" if f.answer == "proven" else "flight" if f.answer == "refuted" else "bounded",
            "depth": f.induction or f.depth if f.answer != "refuted" else len(f.flight) - 1,
            "assumptions": assumptions,
            **({"test": str(tests[f.property.id])} if f.property.id in tests else {}),
        }
        for f in findings
    ]
    return {"machine": compiled.checked.name, "source_hash": source_hash(compiled.checked), "results": rows}


def _text(compiled: Compilation, progress: Progress, findings: Sequence[Finding], tests: dict[str, Path]) -> str:
    rows = []
    for f in findings:
        p = f.property
        answer = _OF_STATES[f.answer] if p.kind == "state" else str(f.answer)
        rows.append((answer, str(p), _method(f), "" if p.kind == "state" else p.text))
    widths = [max((len(row[n]) for row in rows), default=0) for n in range(3)]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, (*widths, 0), strict=True)).rstrip() for row in rows]
    lines += [f"{path} repeats {id_}" for id_, path in tests.items()]
    counts = {a: sum(f.answer == a for f in findings) for a in ("proven", "refuted", "open")}
    lines.append("")
    lines += [f"assumed: {text}" for text in _assumptions(compiled, progress)]
    total = ", ".join(f"{n} {answer}" for answer, n in counts.items())
    return "\n".join([*lines, f"{compiled.checked.name}: {total}"]) + "\n"
