# SPDX-License-Identifier: Apache-2.0
"""The trace matrix of a machine: each requirement with its code, what exercised it, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import TwinError
from ..machine_build import build_config
from ..run import open_run
from .evidence import Proof, Test, read_campaign, read_coverage, read_proofs, read_tests

if TYPE_CHECKING:
    from fcsl_compiler.api.requirements import RequirementPlaces


@dataclass(frozen=True)
class Files:
    """The evidence: files of tests, folders of campaigns, reports of coverage, files of proofs."""

    tests: Sequence[str] = ()
    campaigns: Sequence[str] = ()
    cover: str | None = None
    proofs: str | None = None


@dataclass
class Row:
    """`code` says where it stands, and what assigns the fields that it names. `tests` exercised it and passed, `failed`
    exercised it and failed, `violating` violated it as they say; `named` are those whose mark names it. `campaigns` have for
    each folder the cases flown, those that exercised it, those that violated it. `mcdc`: conditions met, of how many, in the
    algorithms that it watches. `gaps` say what is missing."""

    id: str
    text: str
    kind: str
    condition: str
    assumed: bool
    code: RequirementPlaces
    tests: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    violating: list[str] = field(default_factory=list)
    named: list[str] = field(default_factory=list)
    campaigns: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    mcdc: tuple[int, int] | None = None
    proofs: list[Proof] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)


def matrix(config: str, files: Files) -> list[Row]:
    """A row for each requirement of the machine, those with gaps first. Raises TwinError."""
    from fcsl_compiler.api.requirements import requirement_places  # here: it imports the compiler

    with closing(open_run(*build_config(config))) as run:
        machine, source_hash, verdicts = run.machine.name, run.machine.source_hash, run.verdicts()
    if not verdicts:
        raise TwinError(f"{config}: the machine has no requirements")
    code = requirement_places(Path(config))
    rows = {v.id: Row(v.id, v.text, v.kind, v.source, v.assumed, code[v.id]) for v in verdicts}
    for test in (test for file in files.tests for test in read_tests(Path(file))):
        _add_test(rows, test, machine)
    for folder in files.campaigns:
        for id_, counts in read_campaign(Path(folder), rows).items():
            rows[id_].campaigns[folder] = counts
    if files.cover is not None:
        coverage = read_coverage(Path(files.cover), machine)
        for row in rows.values():
            own = [mcdc for algorithms, mcdc in coverage if set(algorithms) & set(row.code.algorithms)]
            row.mcdc = (sum(met for met, _ in own), sum(total for _, total in own))
    if files.proofs is not None:
        for id_, proofs in read_proofs(Path(files.proofs), machine, source_hash).items():
            if id_ in rows:
                rows[id_].proofs = proofs
    for row in rows.values():
        row.gaps = _gaps(row, bool(files.tests))
    return sorted(rows.values(), key=lambda row: not row.gaps)


def _add_test(rows: dict[str, Row], test: Test, machine: str) -> None:
    exercised, violated = test.machines.get(machine, ([], []))
    for id_ in exercised:
        if id_ in rows and test.outcome in ("passed", "failed"):
            (rows[id_].tests if test.outcome == "passed" else rows[id_].failed).append(test.name)
    for id_ in violated:
        if id_ in rows and test.outcome == "passed":
            rows[id_].violating.append(test.name)
    for id_ in test.named:
        if id_ in rows:
            rows[id_].named.append(test.name)


def _gaps(row: Row, has_tests: bool) -> list[str]:
    gaps = []
    if not row.tests:
        gaps.append("no test exercises it" if has_tests else "no tests are given")
    if row.failed:
        gaps.append(f"{len(row.failed)} tests that exercise it fail")
    if any(violated for _, _, violated in row.campaigns.values()) and not row.assumed:
        gaps.append("a campaign violates it")
    if any(proof.answer == "refuted" for proof in row.proofs):
        gaps.append("it is refuted")
    return gaps
