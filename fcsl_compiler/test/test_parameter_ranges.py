# SPDX-License-Identifier: Apache-2.0
"""Ranges of parameters whose bounds are constants of the module."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine

LIMITS = """
SLOW = 0.5
"""
LAW = """
from limits import SLOW

MOST = 2 * 12.5
COUNT = 8
SINGLE: f32 = 0.1


class Law:
    parameters = {
        "force": "f64 N in -MOST..MOST",
        "speed": "f64 m/s in SLOW..",
        "steps": "i32 in ..COUNT",
        "share": "f32 in 0..SINGLE = 0.05",
    }
    outputs = {"y": "f64"}

    def execute(self):
        self.y = self.force + self.speed + f64(self.steps) + f64(self.share)
"""
GOOD = {"force": -25.0, "speed": 0.5, "steps": 8}


def machine(folder: Path, **parameters: Any) -> Path:
    (folder / "limits.py").write_text(LIMITS)
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law", "parameters": GOOD | parameters}},
        "states": {"A": {"schedule": {"law": 10}}},
    }
    return write_machine(folder, "ranges", config, {"law": LAW})


def test_bounds_themselves_are_inside(tmp_path: Path) -> None:
    build_machine(machine(tmp_path))
    build_machine(machine(tmp_path, force=25.0))


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("force", -25.1, "-25.0..25.0"),
        ("force", 25.1, "-25.0..25.0"),
        ("speed", 0.49, "0.5.."),
        ("steps", 9, "..8"),
        ("share", 0.11, "0..0.10000000149011612"),
    ],
)
def test_values_outside_are_refused_with_the_numbers(tmp_path: Path, name: str, value: float, shown: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path, **{name: value}))
    assert f"`{name}`" in str(caught.value) and shown in str(caught.value)
