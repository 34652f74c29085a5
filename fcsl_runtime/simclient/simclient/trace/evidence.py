# SPDX-License-Identifier: Apache-2.0
"""Reads what speaks for or against requirements: tests, campaigns, coverage and proofs. All raise TwinError."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ..errors import TwinError

_T = TypeVar("_T")
_ANSWERS = ("proven", "refuted", "open")


@dataclass(frozen=True)
class Test:
    """`machines`: by name, the ids of the requirements that it exercised and that it violated. `named`: those of its mark."""

    name: str
    outcome: str
    named: list[str]
    machines: dict[str, tuple[list[str], list[str]]]


@dataclass(frozen=True)
class Proof:
    """`answer`: proven, refuted, or open: searched to `depth` ticks."""

    answer: str
    method: str
    depth: int
    assumptions: list[str]

    def __str__(self) -> str:
        return f"open to {self.depth} ticks" if self.answer == "open" else f"{self.answer} ({self.method})"


def read_tests(file: Path) -> list[Test]:
    """Of a file of `fcsl test --fcsl-requirements`."""
    return _read(file, "file of `fcsl test --fcsl-requirements`", lambda found: list(map(_test, _list(found["tests"]))))


def _test(found: Any) -> Test:
    machines = {
        _text(name): (_texts(own["exercised"]), _texts(own["violated"])) for name, own in found["machines"].items()
    }
    return Test(_text(found["test"]), _text(found["outcome"]), _texts(found["named"]), machines)


def read_campaign(folder: Path, ids: Collection[str]) -> dict[str, tuple[int, int, int]]:
    """By id, of those requirements that it has: cases flown, cases that exercised it, cases that violated it."""
    import pyarrow as pa  # imported here, because it takes long to load
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(folder / "cases.parquet")
    except (OSError, pa.ArrowException) as error:
        raise TwinError(f"{folder}: it is no folder of a finished campaign: {str(error).splitlines()[0]}") from None
    found = {}
    for id_ in ids:
        if f"requirement.{id_}" in table.column_names:
            counts = [n for n in table[f"requirement.{id_}"].to_pylist() if n == n]
            found[id_] = (len(table), len(counts), sum(n > 0.0 for n in counts))
    if not found:
        raise TwinError(f"{folder}: the campaign is of another machine, or of other requirements")
    return found


def read_coverage(file: Path, machine: str) -> list[tuple[list[str], tuple[int, int]]]:
    """For each algorithm file of the machine the names of its algorithms, and its MC/DC: conditions met, of how many."""

    def parse(found: Any) -> list[tuple[list[str], tuple[int, int]] | None]:
        files = [f for m in _list(found["machines"]) if m["machine"] == machine for f in _list(m["files"])]
        return [
            None if f["changed"] else (_texts(f["algorithms"]), (_count(f["mcdc"]["met"]), _count(f["mcdc"]["total"])))
            for f in files
        ]

    every = _read(file, "report of `fcsl cover --output`", parse)
    known = [found for found in every if found is not None]
    if len(known) < len(every):
        raise TwinError(f"{file}: algorithms have changed since their coverage was measured: run `fcsl cover` again")
    if not known:
        raise TwinError(f"{file}: it has no coverage of `{machine}`")
    return known


def read_proofs(file: Path, machine: str, source_hash: str) -> dict[str, list[Proof]]:
    """By id of a requirement."""

    def parse(found: Any) -> tuple[str, str, list[tuple[str, Proof]]]:
        results = [r for r in _list(found["results"]) if r["kind"] == "requirement"]
        return _text(found["machine"]), _text(found["source_hash"]), [(_text(r["id"]), _proof(r)) for r in results]

    of, hash_, results = _read(file, "file of `fcsl prove --json`", parse)
    if of != machine:
        raise TwinError(f"{file}: the proofs are of machine `{of[:80]}`, not of `{machine}`")
    if hash_ != source_hash:
        raise TwinError(f"{file}: `{machine}` has changed since the proofs: run `fcsl prove` again")
    proofs: dict[str, list[Proof]] = {}
    for id_, proof in results:
        proofs.setdefault(id_, []).append(proof)
    return proofs


def _proof(found: Any) -> Proof:
    if found["answer"] not in _ANSWERS:
        raise ValueError
    return Proof(found["answer"], _text(found["method"]), _count(found["depth"]), _texts(found["assumptions"]))


def _read(file: Path, what: str, parse: Callable[[Any], _T]) -> _T:
    try:
        return parse(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise TwinError(f"{file}: {error.strerror}") from None
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise TwinError(f"{file}: it is no {what}") from None


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _texts(value: Any) -> list[str]:
    return list(map(_text, _list(value)))


def _count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError
    return value
