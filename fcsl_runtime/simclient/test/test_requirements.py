# SPDX-License-Identifier: Apache-2.0
"""Requirements: C, Nim and CPython give the verdicts that their definitions give, of generated formulas."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

import pytest
from requirements_oracle import Generator, Values, verdict, written

from simclient import AlgTwin, PyTwin
from simclient.requirements import Status
from simclient.twin.twin import Twin

TICK_HZ = 100
SOURCE = '''\
class Source:
    inputs = {}
    outputs = {"x": "f64", "y": "f32", "n": "i32", "u": "u64", "b": "bool", "v": "f64[3]"}
    parameters = {}
    state = {}

    def execute(self):
        pass


class Slow:
    inputs = {"x": "f64"}
    outputs = {"z": "f64"}
    parameters = {}
    state = {}

    def execute(self):
        self.z = 2.0 * self.x
'''


def machine(folder: Path, requirements: list[Values], name: str = "craft") -> Path:
    (folder / "craft.py").write_text(SOURCE)
    config = {
        "tick_hz": TICK_HZ,
        "initial_state": "A",
        "algorithms": {"Source": {"source": "craft.py"}, "Slow": {"source": "craft.py"}},
        "instances": {"src": {"algorithm": "Source"}, "slow": {"algorithm": "Slow"}},
        "connections": [{"from": "src.x", "to": "slow.x"}],
        "states": {"A": {"schedule": {"src": 100, "slow": {"hz": 50, "phase": 1}}}, "B": {"schedule": {"src": 100}}},
        "requirements": requirements,
    }
    path = folder / f"{name}.json"
    path.write_text(json.dumps(config))
    return path


def fly(twin: Twin, seed: int, ticks: int) -> list[Values]:
    """Values at random, with NaNs, changes of the state and faults; returns what each tick left."""
    draw = random.Random(seed)
    paths = ("src.outputs.x", "src.outputs.y", "src.outputs.n", "src.outputs.u", "src.outputs.b", "src.outputs.v")
    left = []
    for tick in range(ticks):
        for name in "xy":
            value = draw.choice((math.nan, 0.0, 1.0, 2.0, -1.5, 0.5)) if draw.random() < 0.4 else None
            if value is not None:
                twin.set(f"src.outputs.{name}", value)
        twin.set("src.outputs.n", draw.randint(-1, 3))
        twin.set("src.outputs.u", draw.randint(0, 3))
        if draw.random() < 0.3:
            twin.set("src.outputs.b", draw.random() < 0.5)
        twin.set("src.outputs.v", [draw.choice((0.0, 1.0, math.nan, 3.0)) if draw.random() < 0.1 else 1.0 for _ in "xyz"])
        if draw.random() < 0.06:
            twin.set_state(draw.choice("AB"))
        faulted = draw.random() < 0.1
        if faulted:
            twin.fault("slow")
        twin.tick()
        state = twin.state()
        ran = twin.get_value("slow.outputs.health") == "nominal" and state == "A" and tick % 2 == 1
        values = {path: twin.get_value(path) for path in (*paths, "slow.outputs.z", "slow.outputs.health", "src.outputs.health")}
        left.append({**values, "src.outputs.v[1]": values["src.outputs.v"][1], "machine.state": state, "ran": {"slow"} if ran else set()})
    return left


COUNTS = ("holds", "evaluated", "exercised", "undefined", "violations", "violated_ticks", "first_tick", "last_tick")


@pytest.mark.parametrize("seed", range(4))
def test_generated_formulas_equal_their_definitions(seed: int, tmp_path: Path) -> None:
    generator = Generator(seed, TICK_HZ)
    requirements = [generator.requirement(f"R-{i}") for i in range(60)]
    path = machine(tmp_path, [written(requirement) for requirement in requirements])
    opened: list[tuple[str, Any]] = [("C", AlgTwin.from_config(path)), ("CPython", PyTwin.from_config(path))]
    if seed == 0:
        opened.append(("Nim", AlgTwin.from_config(path, backend="nim")))
    for name, twin in opened:
        with twin:
            left = fly(twin, seed, 90)
            found = twin.requirements
        for requirement in requirements:
            expected = verdict(requirement, left, TICK_HZ)
            got = found[requirement["id"]]
            shown = {count: getattr(got, count) for count in COUNTS}
            assert shown == {count: getattr(expected, count) for count in COUNTS}, (name, written(requirement))
            assert got.faults == 0
    assert sum(v.violations > 0 for v in found.values()) > 10 and sum(v.undefined > 0 for v in found.values()) > 5
    assert {v.status for v in found.values()} == set(Status)
