# SPDX-License-Identifier: Apache-2.0
"""Loops bounded by a frozen parameter. Compiled and in CPython."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_one_each
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine

SOURCE = """
class Average:
    inputs = {"sample": "f64"}
    outputs = {"mean": "f64", "runs": "i64"}
    parameters = {"taps": "i32", "gain": "f64", "skip": "i64"}
    state = {"last": "f64[8]"}

    def execute(self):
        for i in range(self.taps - 1, 0, -1):
            self.last[i] = self.last[i - 1]
        self.last[0] = self.sample
        total = 0
        for i in range(self.taps):
            total += self.last[i]
            for j in range(i, self.taps):
                self.runs += 1
        for i in range(self.skip, self.taps):
            self.runs += 100
        self.mean = self.gain * total / f64(self.taps)
"""


def write(folder: Path, *, frozen: Any = ("taps", "skip"), taps: int = 3, skip: int = 0) -> Path:
    parameters = {"taps": taps, "gain": 2.0, "skip": skip}
    instances = {"average": {"algorithm": "Average", "parameters": parameters, "frozen": frozen}}
    files, algorithms = {"average.py": SOURCE}, {"Average": {"source": "average.py"}}
    return write_one_each(folder, files, algorithms, instances=instances)


@pytest.mark.parametrize("frozen", [["taps", "skip"], True])
def test_a_moving_average(tmp_path: Path, frozen: Any) -> None:
    twins = Twins(write(tmp_path, frozen=frozen, skip=1))
    twins.expect(
        [
            ({"average.inputs.sample": 3.0}, {"average.outputs.mean": 2.0, "average.outputs.runs": 206}),
            ({"average.inputs.sample": 6.0}, {"average.outputs.mean": 6.0, "average.outputs.runs": 412}),
            ({"average.inputs.sample": 9.0}, {"average.outputs.mean": 12.0}),
            ({"average.inputs.sample": 0.0}, {"average.outputs.mean": 10.0}),
        ]
    )


def test_what_the_values_prove_is_not_checked(tmp_path: Path) -> None:
    """With 3 taps of 8 no index can be out of range. With 9 one is, and faults."""
    proven = compile_machine(write(tmp_path / "a"), "").source
    assert "fcsl_index" not in proven
    twins = Twins(write(tmp_path / "b", taps=9))
    twins.expect([({"average.inputs.sample": 1.0}, {"average.counters.faults": 1, "average.outputs.runs": 0})])


def test_a_loop_of_no_turns(tmp_path: Path) -> None:
    twins = Twins(write(tmp_path, taps=1, skip=5))
    twins.expect([({"average.inputs.sample": 4.0}, {"average.outputs.mean": 8.0, "average.outputs.runs": 1})])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"frozen": ["skip"]}, "`taps` of `average` bounds a loop and is not frozen"),
        ({"frozen": []}, "is not frozen"),
        ({"taps": 2000000000}, "iterations"),
        ({"taps": 20000}, "a loop of 400000000 iterations"),
        ({"skip": -(2**40)}, "beyond 2^31"),
        ({"skip": 3 - 10_000_001}, "a loop of 10000001 iterations"),
    ],
)
def test_refused(tmp_path: Path, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(DiagnosticError) as refused:
        compile_machine(write(tmp_path, **arguments), "")
    assert {d.code for d in refused.value.diagnostics} == {"E424"}
    assert any(message in d.message for d in refused.value.diagnostics)


def test_as_many_iterations_as_are_allowed(tmp_path: Path) -> None:
    assert compile_machine(write(tmp_path, skip=3 - 10_000_000), "").source
