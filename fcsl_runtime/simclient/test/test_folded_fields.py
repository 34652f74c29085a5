# SPDX-License-Identifier: Apache-2.0
"""Machines with many instances that are alike: the library has their fields once, and nobody sees a difference."""

import json
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.driver.library import build_library
from fcsl_compiler.emit import field_table
from simclient import AlgTwin, PyTwin
from simclient.descriptor import Machine

PI = """\
class Pi:
    inputs = {"setpoint": "f64 m", "measured": "f64 m", "period": "f64 s"}
    outputs = {"command": "f64"}
    parameters = {"kp": "f64 in 0..100", "ki": "f64 1/s"}
    state = {"integral": "f64[2]"}

    def execute(self):
        error = self.setpoint - self.measured
        self.integral[1] += self.ki * error * self.period
        self.command = self.kp * error + self.integral[1]
"""


def chain(folder: Path, count: int) -> Path:
    """A row of controllers with gains of their own; the machine gives the period of one of them."""
    (folder / "pi.py").write_text(PI)
    names = [f"pi{n}" for n in range(count)]
    config = {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {"Pi": {"source": "pi.py"}},
        "instances": {
            name: {"algorithm": "Pi", "parameters": {"kp": 1.0 + 0.001 * n, "ki": 0.5 + 0.01 * n}}
            for n, name in enumerate(names)
        },
        "connections": [{"from": "machine.period", "to": "pi3.period"}]
        + [{"from": f"{a}.command", "to": f"{b}.setpoint"} for a, b in zip(names, names[1:], strict=False)],
        "channels": [
            {"name": "track", "id": 1, "field": "pi0.inputs.setpoint", "direction": "sensor", "max_age_ticks": 5}
        ],
        "states": {"RUN": {"schedule": dict.fromkeys(names, 1000)}},
        "transitions": [],
    }
    path = folder / f"chain{count}.json"
    path.write_text(json.dumps(config))
    return path


def library(config: Path, name: str) -> Path:
    made = config.parent / name / f"lib{config.stem}.so"
    build_library([config], made)
    return made


def test_one_more_instance_costs_less_than_800_bytes(tmp_path: Path) -> None:
    sizes = {count: library(chain(tmp_path, count), f"{count}").stat().st_size for count in (100, 200)}
    assert (sizes[200] - sizes[100]) / 100 <= 800


def test_folded_fields_are_those_of_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = chain(tmp_path, 80)

    def machine(name: str) -> Machine:
        with AlgTwin.from_library(library(config, name)) as twin:
            return twin.machine

    folded = machine("folded")
    monkeypatch.setattr(field_table, "_FOLDED", 1000)
    flat = machine("flat")
    assert ".fields = NULL" in (tmp_path / "folded/chain80.c").read_text()
    assert ".fields = NULL" not in (tmp_path / "flat/chain80.c").read_text()
    assert folded == flat


def test_twins_of_a_folded_machine_agree(tmp_path: Path) -> None:
    config = chain(tmp_path, 70)

    def values(kind: type[AlgTwin] | type[PyTwin]) -> dict[str, Any]:
        with kind.from_config(config) as twin:
            twin.set("pi0.inputs.setpoint", 1.0)
            twin.set("pi69.parameters.kp", 2.0)
            twin.tick(5)
            return {path: twin.get_value(path) for path in twin.machine.fields}

    compiled = values(AlgTwin)
    assert compiled == values(PyTwin)
    assert compiled["pi69.outputs.command"] > compiled["pi68.outputs.command"] > 1.0
    assert compiled["pi3.state.integral"][1] > compiled["pi2.state.integral"][1] == 0.0
