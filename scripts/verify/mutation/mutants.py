# SPDX-License-Identifier: Apache-2.0
"""What a mutant is, which ones are drawn of a file, and the text of the file that holds them all, each behind its switch."""

from __future__ import annotations

import random
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

EQUIVALENT = Path(__file__).resolve().with_name("equivalent.toml")


@dataclass(frozen=True)
class Point:
    """A place that may be mutated: bytes `begin` to `end` of the file, `before` there and `after` in its place.

    `switched` is the text that holds both, with `{switch}` for the expression that is true when the mutant is to be executed.
    """

    begin: int
    end: int
    line: int
    kind: str
    before: str
    after: str
    switched: str

    def overlaps(self, other: Point) -> bool:
        return self.begin < other.end and other.begin < self.end


@dataclass(frozen=True)
class Candidate:
    """A point of a file, which is relative to the workspace."""

    file: str
    point: Point


@dataclass(frozen=True)
class Mutant:
    """A drawn point. `file` is relative to the workspace; numbers begin with 1."""

    number: int
    file: str
    point: Point

    def __str__(self) -> str:
        return f"{self.file}:{self.point.line}: {self.point.kind}: {self.point.before} → {self.point.after}"


@dataclass(frozen=True)
class Equivalent:
    """A mutant that no test can notice. `line` is the text of its line, so that it is found wherever the line moves."""

    file: str
    line: str
    after: str
    reason: str


def equivalents() -> list[Equivalent]:
    with EQUIVALENT.open("rb") as file:
        return [Equivalent(**row) for row in tomllib.load(file).get("mutant", [])]


def is_equivalent(point: Point, file: str, lines: Sequence[str], known: Sequence[Equivalent]) -> bool:
    here = lines[point.line - 1].strip()
    return any(e.file == file and e.line == here and e.after == point.after for e in known)


def draw(candidates: Sequence[Candidate], count: int, seed: int, compiles: Callable[[Candidate], bool]) -> list[Mutant]:
    """At most `count` mutants that compile and do not overlap, each candidate as likely as any other; the same ones for the same
    seed and sources."""
    order = list(candidates)
    random.Random(seed).shuffle(order)
    chosen: list[Candidate] = []
    for one in order:
        if len(chosen) == count:
            break
        if not any(one.file == c.file and one.point.overlaps(c.point) for c in chosen) and compiles(one):
            chosen.append(one)
    chosen.sort(key=lambda c: (c.file, c.point.begin))
    return [Mutant(number, c.file, c.point) for number, c in enumerate(chosen, 1)]


def with_switches(source: bytes, mutants: Sequence[Mutant], switch: Callable[[int], str]) -> bytes:
    """The file with every mutant behind its switch. Mutants do not overlap."""
    text = source
    for m in sorted(mutants, key=lambda m: m.point.begin, reverse=True):
        switched = m.point.switched.replace("{switch}", switch(m.number)).encode()
        text = text[: m.point.begin] + switched + text[m.point.end :]
    return text


def shown(text: str) -> str:
    """On one line."""
    return " ".join(text.split())
