# SPDX-License-Identifier: Apache-2.0
"""Instances of one algorithm share a record and its execute where both are equal, and init where they begin alike."""

import math
import re
from pathlib import Path

import pytest
from fcsl_test_abi import Machine, write_machine

from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.passes import compile_machine

GAIN = """
class Gain:
    inputs = {"x": "f64", "since": "f64", "at": "u32"}
    outputs = {"y": "f64"}
    parameters = {"k": "f64"}
    state = {"ran": "u32[2]"}

    def execute(self):
        self.ran[self.at] += 1
        self.y = self.k * self.x / (self.k - self.since)
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    def gain(k: float, **more: object) -> dict[str, object]:
        return {"algorithm": "Gain", "parameters": {"k": k}, "inputs": {"x": 1.0}, **more}

    names = ("first", "second", "frozen", "guarded", "timed")
    return write_machine(
        tmp_path,
        "m",
        {
            "tick_hz": 10,
            "initial_state": "A",
            "instances": {
                "first": gain(2.0),
                "second": gain(3.0),
                "frozen": gain(4.0, frozen=["k"]),
                "guarded": gain(5.0),
                "timed": gain(6.0),
            },
            "connections": [{"from": "machine.elapsed", "to": "timed.since"}],
            "channels": [{"name": "x", "id": 1, "field": "guarded.inputs.x", "direction": "sensor"}],
            "states": {"A": {"schedule": dict.fromkeys(names, 10)}},
            "transitions": [],
        },
        {"gain": GAIN},
    )


def test_only_equal_code_is_shared(config: Path) -> None:
    header = compile_machine(config, "").header
    assert "typedef m_first_t m_second_t;" in header
    for name in ("frozen", "guarded", "timed"):
        assert f"}} m_{name}_t;" in header, "it has code of its own"


@pytest.mark.parametrize("backend", ["c", "nim"])
def test_each_has_its_own_data(config: Path, backend: str) -> None:
    built = build_machine(config, backend=backend)
    machine = Machine(built.library, built.name)
    machine.set("second.inputs.at", 2)  # a fault
    machine.step(2)
    assert [machine.get(f"{name}.outputs.y") for name in ("first", "frozen", "guarded")] == [1.0, 1.0, 1.0]
    assert machine.get("timed.outputs.y") == 6.0 / (6.0 - 0.1)
    assert [machine.get(f"{name}.counters.faults") for name in ("first", "second")] == [0, 2]
    assert [machine.get(f"{name}.state.ran") for name in ("first", "second")] == [[2, 0], [0, 0]]


@pytest.mark.parametrize("backend", ["c", "nim"])
def test_init_is_shared_where_the_values_are_equal(tmp_path: Path, backend: str) -> None:
    """Bit for bit: 0.0 and -0.0 are different beginnings."""
    gains = {"first": 0.0, "same": 0.0, "negative": -0.0, "other": 2.5}
    machine = {
        "tick_hz": 10,
        "initial_state": "A",
        "instances": {name: {"algorithm": "Gain", "parameters": {"k": k}} for name, k in gains.items()},
        "states": {"A": {"schedule": dict.fromkeys(gains, 10)}},
        "transitions": [],
    }
    config = write_machine(tmp_path, "m", machine, {"gain": GAIN})
    header = compile_machine(config, "").header
    inits = dict(re.findall(r"void m_(\w+)_init\(\w+ \*self\)\n\{\n(.*?)\n\}", header, re.S))
    assert {name for name, body in inits.items() if "memset" in body} == {"first", "negative", "other"}
    assert inits["same"] == "    m_first_init(self);"
    built = build_machine(config, backend=backend)
    twin = Machine(built.library, built.name)
    found = {name: twin.get(f"{name}.parameters.k") for name in gains}
    assert found == gains and [n for n, k in found.items() if math.copysign(1.0, k) < 0] == ["negative"]
