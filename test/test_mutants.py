# SPDX-License-Identifier: Apache-2.0
"""Mutants of Python (scripts/verify/mutation): switched off the file is what it was, switched on it is what the report says."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))
from verify.mutation import tests as mutation_tests
from verify.mutation.mutants import Candidate, Equivalent, Mutant, draw, is_equivalent, with_switches
from verify.mutation.python_points import points

FILE = "some.py"
SOURCE = b"""LIMIT = 3


def total(values, limit=LIMIT):
    found = []
    for value in values:
        if value < limit and not value == 1:
            continue
        found.append(value)
    return (
        len(found) * 2
    ), found
"""
VALUES = [1, 2, 3, 4]
#: Line, what became of the expression, and what `total` returns then.
EXPECTED = [
    (7, "value < limit or not value == 1", (0, [])),
    (7, "value <= limit", (4, [1, 4])),
    (7, "value >= limit", (4, [1, 2])),
    (7, "value == 1", (6, [2, 3, 4])),
    (7, "value != 1", (6, [2, 3, 4])),
    (7, "2", (6, [2, 3, 4])),
    (8, "", (8, [1, 2, 3, 4])),
    (9, "", (0, [])),
    (10, "None", None),
    (11, "len(found) // 2", (1, [1, 3, 4])),
    (11, "3", (9, [1, 3, 4])),
]


def total_of(mutants: list[Mutant], active: int, monkeypatch: pytest.MonkeyPatch) -> object:
    hook = types.ModuleType("fcsl_mutants")
    hook.mutant = lambda number: number == active  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "fcsl_mutants", hook)
    scope: dict[str, Callable[[list[int]], object]] = {}
    exec(with_switches(SOURCE, mutants, lambda n: f"__import__('fcsl_mutants').mutant({n})"), scope)
    return scope["total"](VALUES)


def test_every_mutant_is_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for point in points(SOURCE):
        mutants = [Mutant(1, FILE, point)]
        assert total_of(mutants, 0, monkeypatch) == (6, [1, 3, 4]), point
        found.append((point.line, point.after, total_of(mutants, 1, monkeypatch)))
    assert sorted(found, key=repr) == sorted(EXPECTED, key=repr)


def test_what_only_asserts_equal_lengths_is_no_mutant() -> None:
    source = b"def pairs(a, b):\n    return list(zip(a, b, strict={}))\n"
    found = {flag: [p.after for p in points(source.replace(b"{}", flag))] for flag in (b"True", b"False")}
    assert found == {b"True": ["None"], b"False": ["None", "True"]}


def test_drawn_mutants_are_switched_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    candidates = [Candidate(FILE, point) for point in points(SOURCE)]
    mutants = draw(candidates, 4, 1, lambda _: True)
    assert mutants == draw(candidates, 4, 1, lambda _: True) and [m.number for m in mutants] == [1, 2, 3, 4]
    assert total_of(mutants, 0, monkeypatch) == (6, [1, 3, 4])
    for m in mutants:
        alone = total_of([Mutant(1, FILE, m.point)], 1, monkeypatch)
        assert total_of(mutants, m.number, monkeypatch) == alone != (6, [1, 3, 4])


def test_an_equivalent_is_known_by_the_text_of_its_line() -> None:
    known = [Equivalent(FILE, "if value < limit and not value == 1:", "value <= limit", "an example")]
    lines = SOURCE.decode().split("\n")
    left = [p for p in points(SOURCE) if not is_equivalent(p, FILE, lines, known)]
    assert [p.after for p in points(SOURCE) if p not in left] == ["value <= limit"]


def test_each_folder_of_tests_has_a_run_of_its_own() -> None:
    """In one run, files of one name (test_cli.py) could not be imported, and that killed whatever was tested."""
    names = ["fcsl_sim/test/test_cli.py::a", "fcsl_compiler/test/test_cli.py::a", "fcsl_sim/test/test_plan.py::b"]
    parts = mutation_tests.by_folder([mutation_tests.Test(name, 1.0, frozenset()) for name in names])
    assert [[t.name for t in part] for part in parts] == [[names[1]], [names[0], names[2]]]
