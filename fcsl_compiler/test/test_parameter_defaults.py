# SPDX-License-Identifier: Apache-2.0
"""Defaults of parameters: values that a machine JSON may leave out. Compiled and in CPython."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine

LAW = """
class Law:
    parameters = {
        "gain": "f64 N/rad in 0..10 = 2.5",
        "single": "f32 = 0.1",
        "count": "i32 = -3",
        "on": "bool = true",
        "bias": "f64[3] rad/s = 0.5",  # of each axis
        "matrix": "f64[2][2] = [[1, 0], [0, 1]]",
        "pose": 'Pose = {"height": 4, "valid": true}',
        "word": 'Health = "degraded"',
        "on_done": 'TransitionRequest = "DONE"',
        "needed": "f64[n]",
    }
    outputs = {"y": "f64", "transition_request": "TransitionRequest"}

    def execute(self):
        self.health = self.word
        self.transition_request = self.on_done if self.on else ""
        self.y = self.gain + f64(self.single) + f64(self.count) + sum(self.bias) + self.matrix[1, 1] + self.pose.height
        self.y += sum(self.needed)
"""


def machine(folder: Path, frozen: Any = False, **parameters: Any) -> Path:
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "structs": {"Pose": {"height": "f64", "valid": "bool"}},
        "algorithms": {"Law": {"source": "law.py", "sizes": {"n": 2}}},
        "instances": {"law": {"algorithm": "Law", "parameters": parameters, "frozen": frozen}},
        "states": {"A": {"schedule": {"law": 10}}, "B": {"schedule": {}}},
        "transitions": [{"from": "A", "to": "B", "request": "DONE"}],
    }
    return write_machine(folder, "several", config, {"law": LAW})


@pytest.mark.parametrize("frozen", [False, True])
def test_defaults(tmp_path: Path, frozen: bool) -> None:
    twins = Twins(machine(tmp_path, frozen, needed=[10, 20]))
    twins.step()
    single = 0.10000000149011612
    assert twins.native.get("law.outputs.y") == 2.5 + single - 3.0 + 1.5 + 1.0 + 4.0 + 30.0
    assert twins.native.get("law.outputs.health") == "degraded"
    twins.step()
    assert twins.native.state == "B"
    if not frozen:
        assert twins.native.get("law.parameters.bias") == [0.5, 0.5, 0.5]


def test_a_value_replaces_a_default(tmp_path: Path) -> None:
    twins = Twins(machine(tmp_path, needed=[0, 0], gain=10, bias=[1, 2, 3], on=False))
    twins.step()
    assert twins.native.get("law.parameters.gain") == 10.0 and twins.native.state == "A"
    assert twins.native.get("law.outputs.y") == 10.0 + 0.10000000149011612 - 3.0 + 6.0 + 1.0 + 4.0


def test_a_parameter_without_default_is_required(tmp_path: Path) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path))
    assert [(d.code, d.message) for d in caught.value.diagnostics] == [
        ("E211", "parameter `needed` of `law` has no value")
    ]


def test_a_default_may_be_out_of_use(tmp_path: Path) -> None:
    """A request that only a default names must be one of the machine."""
    path = machine(tmp_path, needed=[0, 0])
    path.write_text(path.read_text().replace('"DONE"', '"FINISHED"'))
    with pytest.raises(DiagnosticError) as caught:
        build_machine(path)
    assert "E225" in [d.code for d in caught.value.diagnostics]
