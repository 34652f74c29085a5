# SPDX-License-Identifier: Apache-2.0
"""The trace matrix: where requirements stand in the code, and the files of evidence that it reads."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from simclient import AlgTwin, TwinError
from simclient.trace.command import main
from simclient.trace.matrix import Files, matrix

SOURCE = """\
class Gauge:
    inputs = {"volts": "f64"}
    outputs = {"level": "f64", "high": "bool"}

    def execute(self):
        self.level = 2.0 * self.volts
        if self.level > 3.0:
            self.high = True
        else:
            self.high = False
"""
MACHINE = """\
{
  "tick_hz": 100, "initial_state": "RUN",
  "algorithms": {"Gauge": {"source": "gauge.py"}},
  "instances": {"one": {"algorithm": "Gauge"}, "two": {"algorithm": "Gauge"}},
  "connections": [{"from": "one.level", "to": "two.volts"}],
  "states": {"RUN": {"schedule": {"one": 100, "two": 100}}},
  "requirements": [
    {"id": "HIGH", "text": "It is high above 3 V.", "when": "two.inputs.volts > 3.0", "then": "two.outputs.high"},
    {"id": "RUN", "text": "It runs.", "then": "machine.state == 'RUN'"},
    {"id": "LOW", "text": "It is low.", "never": "one.outputs.level > 9.0"}
  ]
}
"""


def cover(**changes: Any) -> dict[str, Any]:
    file = {"algorithms": ["Gauge"], "changed": False, "mcdc": {"met": 1, "total": 2}, **changes}
    return {"machines": [{"machine": "craft", "files": [file]}, {"machine": "other", "files": [file]}]}


def result(id_: str, answer: str) -> dict[str, Any]:
    found = {"answer": answer, "method": "k-induction", "depth": 20, "assumptions": ["0 <= one.inputs.volts <= 5"]}
    return {"kind": "requirement", "id": id_, **found}


@pytest.fixture
def config(tmp_path: Path) -> Path:
    (tmp_path / "gauge.py").write_text(SOURCE)
    (tmp_path / "craft.json").write_text(MACHINE)
    return tmp_path / "craft.json"


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, Any], str]:
    def write(name: str, content: Any) -> str:
        (tmp_path / name).write_text(content if isinstance(content, str) else json.dumps(content))
        return str(tmp_path / name)

    return write


def test_code_coverage_and_proofs(config: Path, write: Callable[[str, Any], str], tmp_path: Path) -> None:
    with AlgTwin.from_config(config) as twin:
        source_hash = twin.machine.source_hash
    ran = {"exercised": ["HIGH", "RUN", "LOW"], "violated": []}
    tests = {"tests": [{"test": "a", "outcome": "passed", "named": [], "machines": {"craft": ran}}]}
    results = [result("HIGH", "proven"), result("RUN", "open"), result("LOW", "refuted")]
    proofs = {"machine": "craft", "source_hash": source_hash, "results": results}
    given = [
        *("--tests", write("tests.json", tests), "--cover", write("cover.json", cover())),
        *("--proofs", write("proofs.json", proofs)),
    ]
    for form in ("json", "csv", "html"):
        assert main([str(config), *given, "-o", str(tmp_path / f"trace.{form}")]) == 1
    low, high, run = json.loads((tmp_path / "trace.json").read_text())["requirements"]
    assert [low["gaps"], high["gaps"], run["gaps"]] == [["it is refuted"], [], []]  # an open one is none
    assert high["code"]["at"] == "craft.json:8"
    # `two.high`, and of its input `one.level`
    assert high["code"]["python"] == ["gauge.py:6", "gauge.py:8", "gauge.py:10"]
    assert run["code"]["python"] == run["code"]["c"] == []
    assert (high["mcdc"], run["mcdc"]) == ([1, 2], [0, 0])
    for form in ("csv", "html"):
        text = (tmp_path / f"trace.{form}").read_text()
        assert "proven (k-induction)" in text and "open to 20 ticks" in text and "1 of 2" in text
        assert all(place in text for place in high["code"]["c"])


def test_places_of_c_are_those_of_the_statements(config: Path, tmp_path: Path) -> None:
    from fcsl_compiler.api.build import build_machine

    (row,) = (row for row in matrix(str(config), Files()) if row.id == "LOW")
    folder = build_machine(config).library.parent

    def lines(place: str) -> str:
        file, _, numbers = place.partition(":")
        first, _, last = numbers.partition("-")
        return "\n".join((folder / file).read_text().splitlines()[int(first) - 1 : int(last or first)])

    assert [place.partition(":")[0] for place in row.code.c] == ["craft.c"]
    assert "level" in lines(row.code.c[0])
    assert "Monitor_low__execute" in lines(row.code.monitor) and "9.0" in lines(row.code.monitor)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "No such file"),
        ("{", "is no file of `fcsl test --fcsl-requirements`"),
        ('{"tests": [{"test": "a", "outcome": "passed", "named": [], "machines": []}]}', "is no file of"),
        ('{"tests": 3}', "is no file of"),
        ("[" * 100_000, "is no file of"),
    ],
    ids=["absent", "half", "list", "number", "deep"],
)
def test_files_of_other_programs_are_not_traced(
    content: str | None, message: str, config: Path, tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "tests.json").write_text(content)
    with pytest.raises(TwinError, match=message):
        matrix(str(config), Files([str(tmp_path / "tests.json")]))


def test_a_folder_without_a_campaign(config: Path, tmp_path: Path) -> None:
    with pytest.raises(TwinError, match="is no folder of a finished campaign"):
        matrix(str(config), Files(campaigns=[str(tmp_path)]))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"machines": []}, "it has no coverage of `craft`"),
        (cover(changed=True), "run `fcsl cover` again"),
        (cover(mcdc={"met": -1, "total": 2}), "it is no report of `fcsl cover --output`"),
        ([], "it is no report of"),
    ],
    ids=["none", "changed", "negative", "list"],
)
def test_a_wrong_report_of_coverage(content: Any, message: str, config: Path, write: Callable[[str, Any], str]) -> None:
    with pytest.raises(TwinError, match=message):
        matrix(str(config), Files(cover=write("cover.json", content)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"machine": "rover", "source_hash": "", "results": []}, "are of machine `rover`, not of `craft`"),
        ({"machine": "craft", "source_hash": "0", "results": []}, "`craft` has changed since the proofs"),
        ({"machine": "craft", "source_hash": "0", "results": [result("LOW", "maybe")]}, "it is no file of `fcsl prove"),
        ({"machine": "craft", "results": [{}]}, "it is no file of `fcsl prove"),
    ],
    ids=["machine", "hash", "answer", "kind"],
)
def test_wrong_proofs(content: Any, message: str, config: Path, write: Callable[[str, Any], str]) -> None:
    with pytest.raises(TwinError, match=message):
        matrix(str(config), Files(proofs=write("proofs.json", content)))
