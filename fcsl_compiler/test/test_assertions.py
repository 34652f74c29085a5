# SPDX-License-Identifier: Apache-2.0
"""`assert`: a contained fault with place and text, compiled and in CPython."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_programs import build
from fcsl_test_twins import InReference, Twins

from fcsl_compiler.cli.main import main

LAW = """
def root(x: f64) -> f64:
    assert x >= 0.0, "a negative square"
    return sqrt(x)


class Law:
    inputs = {"mass": "f64", "k": "i32"}
    outputs = {"y": "f64"}
    state = {"runs": "i32", "v": "f64[3]"}

    def execute(self):
        self.runs = self.runs + 1
        self.y = -1.0
        assert self.mass > 0.0 and self.k != 3, "dry mass"
        self.v[1] = self.mass
        self.y = root(self.mass - 1.0)
"""


def law(folder: Path) -> Twins:
    return build(folder, "law", LAW, {})


@pytest.mark.parametrize(
    ("mass", "k", "fault"),
    [
        (5.0, 0, None),
        (0.0, 0, ("law.py", 15, 9, "assertion failed: dry mass")),
        (float("nan"), 0, ("law.py", 15, 9, "assertion failed: dry mass")),
        (5.0, 3, ("law.py", 15, 9, "assertion failed: dry mass")),
        (0.5, 0, ("law.py", 3, 5, "assertion failed: a negative square")),
    ],
)
def test_a_failing_one_is_a_fault(tmp_path: Path, mass: float, k: int, fault: Any) -> None:
    """Outputs and state are those of the run before, and the next run goes on from there."""
    twins = law(tmp_path)
    twins.set("one.inputs.mass", 5.0)
    twins.step()
    twins.set("one.inputs.mass", mass)
    twins.set("one.inputs.k", k)
    twins.step()
    assert twins.native.fault("one") == twins.python.fault("one") == fault
    assert twins.get("one.outputs.health") == ("failed" if fault else "nominal")
    assert twins.get("one.state.runs") == (1 if fault else 2)
    assert (twins.get("one.outputs.y"), twins.get("one.state.v")) == (2.0, [0.0, 5.0, 0.0])
    twins.set("one.inputs.mass", 10.0)
    twins.set("one.inputs.k", 0)
    twins.step()
    assert (twins.get("one.outputs.y"), twins.get("one.outputs.health")) == (3.0, "nominal")


def test_one_in_start_makes_init_fail(tmp_path: Path) -> None:
    text = LAW + '\n    def start(self):\n        assert self.runs > 0, "never"\n'
    config = {"tick_hz": 1, "initial_state": "A", "instances": {"one": {"algorithm": "Law"}}}
    path = write_machine(tmp_path, "law", config | {"states": {"A": {"schedule": {"one": 1}}}}, {"law": text})
    for build_one in (Machine.build, InReference.build):
        machine = build_one(path)
        assert machine.init_result == 1
        assert machine.fault("one") == ("law.py", 20, 9, "assertion failed: never")


def test_what_is_certain_costs_nothing(tmp_path: Path) -> None:
    """Bounds of integers and constants decide it; floats are not known."""
    body = """
MOST = 4
class Law:
    inputs = {"x": "f64", "k": "i32"}
    outputs = {"y": "f64", "n": "i32"}
    def execute(self):
        assert MOST == 4
        for i in range(MOST):
            assert 0 <= i < MOST, "inside"
            assert i != 4 and (i < 4 or self.k > 0)
            self.n = i
        k = clamp(self.k, 0, 9)
        assert k <= 9 and k >= 0 and k > -1
"""
    twins = build(tmp_path, "law", body, {})
    assert [place for place in twins.native.fault_places() if place[0]] == []
    for line in ("assert k < 9", "assert k > 0", "assert k != 5", "assert self.x == self.x", "assert MOST == 3"):
        (tmp_path / line).mkdir()
        twins = build(tmp_path / line, "law", body + f"        {line}\n", {})
        assert len(twins.native.fault_places()) == 2, line


def test_python_without_assertions_has_them(tmp_path: Path) -> None:
    """`python -O` drops those of Python, not those of algorithms."""
    law(tmp_path)
    config = next(tmp_path.rglob("*.json"))
    program = f"""
from fcsl_test_twins import InReference
from pathlib import Path
machine = InReference.build(Path({str(config)!r}))
machine.step()
print(machine.fault("one"))
"""
    line = [sys.executable, "-O", "-c", program]
    done = subprocess.run(line, cwd=Path(__file__).parent, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "('law.py', 15, 9, 'assertion failed: dry mass')"


def test_the_report_counts_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = 'class Law:\n    inputs = {"x": "f64"}\n    outputs = {"y": "f64"}\n\n    def execute(self):\n        self.y = self.x\n'
    rows = []
    for name, body in (("without", text), ("with", text + "        assert self.x > 0.0\n")):
        config = {"tick_hz": 10, "initial_state": "A", "algorithms": {"Law": {"source": "law.py"}}}
        config |= {"instances": {"law": {"algorithm": "Law"}}, "states": {"A": {"schedule": {"law": 10}}}}
        (tmp_path / name).mkdir()
        path = write_machine(tmp_path / name, "one", config, {"law": body})
        assert main(["build", "--report", "--json", str(path), "-o", str(tmp_path / name / "build")]) == 0
        rows.append(capsys.readouterr().out)
    assert '"rollback_bytes": 0' in rows[0] and '"rollback_bytes": 8' in rows[1]
    assert '"branch": 0' in rows[0] and '"branch": 1' in rows[1]
