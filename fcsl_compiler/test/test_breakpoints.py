# SPDX-License-Identifier: Apache-2.0
"""Breakpoints in the JSON: parameters, frozen or not, of one dimension or more, also through a helper's constants."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine

LAW = """
STEPS = [0.0, 1.0, 4.0]


def shaped(x: f64) -> f64:
    return interp(x, STEPS, [1.0, 2.0, 3.0])


class Law:
    inputs = {"x": "f64", "y": "f64", "z": "f32"}
    parameters = {"xs": "f64[3]", "ys": "f64[2]", "zs": "f32[4]", "gains": "f64[3][2]"}
    outputs = {"y1": "f64", "y2": "f64", "y3": "f32"}

    def execute(self):
        self.y1 = shaped(self.x) + interp(self.x, self.xs, [1.0, 2.0, 3.0])
        self.y2 = extrapolate2(self.x, self.y, self.xs, self.ys, self.gains)
        self.y3 = interp(self.z, self.zs, self.zs)
"""
GIVEN: dict[str, Any] = {"xs": [0, 1, 2], "ys": [-1, 1], "zs": [0, 0.5, 1, 1.5], "gains": [[0, 1], [1, 2], [2, 3]]}


def codes(folder: Path, frozen: bool, law: str = LAW, **changes: Any) -> list[str]:
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "instances": {"law": {"algorithm": "Law", "parameters": {**GIVEN, **changes}, "frozen": frozen}},
        "states": {"A": {"schedule": {"law": 10}}},
    }
    try:
        found = compile_machine(
            write_machine(folder, "one", config, {"law": law}), "", until="schedule"
        ).sink.diagnostics
    except DiagnosticError as error:
        found = list(error.diagnostics)
    return [f"{d.code} {d.message}" for d in found]


@pytest.mark.parametrize("frozen", [False, True])
def test_values_of_the_json_ascend(tmp_path: Path, frozen: bool) -> None:
    assert codes(tmp_path, frozen) == []
    for change, name, pair in (
        ({"xs": [0, 2, 2]}, "extrapolate2", "2.0 is followed by 2.0"),
        ({"ys": [1, -1]}, "extrapolate2", "1.0 is followed by -1.0"),
        ({"zs": [0, 0.5, 0.25, 1.5]}, "interp", "0.5 is followed by 0.25"),
    ):
        found = codes(tmp_path, frozen, **change)
        assert f"E441 breakpoints of `{name}` do not ascend: {pair}" in found, found
        assert all(text.startswith("E441") for text in found)


def test_a_constant_of_a_helper_ascends(tmp_path: Path) -> None:
    found = codes(tmp_path, False, LAW.replace("[0.0, 1.0, 4.0]", "[0.0, 4.0, 1.0]"))
    assert found == ["E441 breakpoints of `interp` do not ascend: 4.0 is followed by 1.0"]


def test_a_function_of_the_users_own_takes_what_it_wants(tmp_path: Path) -> None:
    own = LAW.replace(
        "def shaped",
        'def interp(x: f64, xs: "f64[3]", ys: "f64[3]") -> f64:\n    return x + xs[0] + ys[0]\n\n\ndef shaped',
    )
    own = own.replace("        self.y3 = interp(self.z, self.zs, self.zs)\n", "        self.y3 = self.zs[0] * self.z\n")
    assert codes(tmp_path, False, own.replace("[0.0, 1.0, 4.0]", "[3.0, 1.0, 4.0]")) == []
