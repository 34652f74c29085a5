# SPDX-License-Identifier: Apache-2.0
"""`"nan": "fail"`: an algorithm that assigns a NaN or an infinity faults in that run, compiled and in CPython."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import InReference, Twins

from fcsl_compiler.driver.library import build_library

NAN, INF = math.nan, math.inf
STRUCTS = {"Pose": {"place": "f64[2]", "tag": "i32"}, "Leg": {"poses": "Pose[2]", "load": "f32"}}
LAW = """class Law:
    inputs = {"x": "f64", "k": "i32", "single": "f32"}
    state = {"sum": "f64", "window": "f64[2][3]"}
    parameters = {"gain": "f64 = 1", "early": "bool = false"}
    outputs = {
        "y": "f64",
        "n": "i32",
        "f": "f32",
        "leg": "Leg",
        "idle": "f64",
    }

    def execute(self):
        self.n = self.k
        self.y = self.gain * self.x
        if self.early:
            return
        self.sum += 1.0
        self.f = self.single
        for i in range(2):
            if self.k == 10 + i:
                self.window[i, 2 - i] = self.x
                return
        self.leg.poses[1].place[self.k % 2] = self.x
        self.sum += self.x
"""
#: Line and column of the declaration, cause.
Y = ("law.py", 6, 9, "output `y` is NaN or infinite")
F = ("law.py", 8, 9, "output `f` is NaN or infinite")
LEG = ("law.py", 9, 9, "output `leg` is NaN or infinite")
SUM = ("law.py", 3, 14, "state `sum` is NaN or infinite")
WINDOW = ("law.py", 3, 28, "state `window` is NaN or infinite")


def machine(folder: Path, nan: str | None = "fail", of: str | None = None, text: str = LAW, **instance: Any) -> Path:
    config: dict[str, Any] = {"tick_hz": 1, "initial_state": "A", "structs": STRUCTS}
    config |= {"states": {"A": {"schedule": {"one": 1}}}}
    config["instances"] = {"one": {"algorithm": "Law"} | ({"nan": of} if of else {}) | instance}
    return write_machine(folder, "finite", config | ({"nan": nan} if nan else {}), {"law": text})


def run(twins: Twins, **inputs: Any) -> tuple[str, Any]:
    for name, value in inputs.items():
        twins.set(f"one.inputs.{name}", value)
    before = twins.get("one.counters.faults")
    twins.step()
    assert twins.native.fault("one") == twins.python.fault("one")
    faulted = twins.get("one.counters.faults") != before
    return twins.get("one.outputs.health"), twins.native.fault("one") if faulted else None


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_what_is_assigned_fails_the_run(tmp_path: Path, value: float) -> None:
    """The first of outputs and then of state, in the order of their declarations, at the declaration. All is undone."""
    twins = Twins(machine(tmp_path))
    assert run(twins, x=2.0, k=4) == ("nominal", None)
    assert run(twins, x=value, k=10) == ("failed", Y)
    assert (twins.get("one.outputs.n"), twins.get("one.outputs.y"), twins.get("one.state.sum")) == (4, 2.0, 3.0)
    assert run(twins, x=1.0, single=value) == ("failed", F)
    twins.set("one.parameters.gain", 0.0)
    assert run(twins, x=1.0, single=1.5, k=0) == ("nominal", None)


@pytest.mark.parametrize(
    ("inputs", "place"), [({"k": 1}, LEG), ({"k": 10}, WINDOW), ({"k": 11}, WINDOW), ({"k": 0}, LEG)]
)
def test_elements_and_members(tmp_path: Path, inputs: dict[str, Any], place: Any) -> None:
    text = LAW.replace("self.y = self.gain * self.x", "self.y = self.gain")
    twins = Twins(machine(tmp_path, text=text))
    assert run(twins, x=NAN, **inputs) == ("failed", place)
    assert run(twins, x=5.0, **inputs) == ("nominal", None)


def test_state_after_outputs(tmp_path: Path) -> None:
    text = LAW.replace("self.y = self.gain * self.x", "self.y = 0.0").replace("[self.k % 2] = self.x", "[0] = 1.0")
    assert run(Twins(machine(tmp_path, text=text)), x=INF) == ("failed", SUM)


def test_an_early_return_is_an_end(tmp_path: Path) -> None:
    twins = Twins(machine(tmp_path, parameters={"early": True}))
    assert run(twins, x=NAN) == ("failed", Y)
    assert run(twins, x=1.0, single=NAN) == ("nominal", None)  # `f` is not assigned in this run


def test_what_a_host_writes_is_not_the_algorithms(tmp_path: Path) -> None:
    """A field that the class never assigns may be NaN; one that it assigns in other runs is what it hands on."""
    twins = Twins(machine(tmp_path, parameters={"early": True}))
    twins.set("one.outputs.idle", NAN)
    assert run(twins, x=1.0) == ("nominal", None)
    twins.set("one.outputs.f", NAN)
    assert run(twins, x=1.0) == ("failed", F)


@pytest.mark.parametrize(("nan", "of"), [(None, None), ("pass", None), ("fail", "pass")])
def test_it_is_passed_on_without(tmp_path: Path, nan: str | None, of: str | None) -> None:
    twins = Twins(machine(tmp_path, nan, of))
    assert run(twins, x=NAN) == ("nominal", None)
    assert math.isnan(twins.get("one.outputs.y"))


def test_an_instance_may_have_it_alone(tmp_path: Path) -> None:
    """Beside one of the same class that passes it on, and one with frozen parameters."""
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": STRUCTS,
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {
            "strict": {"algorithm": "Law", "nan": "fail"},
            "loose": {"algorithm": "Law"},
            "frozen": {"algorithm": "Law", "nan": "fail", "frozen": True, "parameters": {"gain": 0.5}},
        },
        "states": {"A": {"schedule": {"strict": 1, "loose": 1, "frozen": 1}}},
    }
    twins = Twins(write_machine(tmp_path, "some", config, {"law": LAW}))
    for name in ("strict", "loose", "frozen"):
        twins.set(f"{name}.inputs.x", NAN)
    twins.step()
    healths = [twins.get(f"{name}.outputs.health") for name in ("strict", "loose", "frozen")]
    assert healths == ["failed", "nominal", "failed"]


def test_start_fails_init(tmp_path: Path) -> None:
    text = LAW + "\n    def start(self):\n        self.sum = 0.0 * self.gain / 0.0\n"
    path = machine(tmp_path, text=text)
    for made in (Machine.build(path), InReference.build(path)):
        assert made.init_result == 1 and made.fault("one") == SUM


def test_it_costs_nothing_where_nothing_is_a_float(tmp_path: Path) -> None:
    text = 'class Law:\n    inputs = {"k": "i32"}\n    outputs = {"n": "i32", "on": "bool"}\n\n'
    text += "    def execute(self):\n        self.n = wrap_add(self.k, 1)\n        self.on = self.k > 0\n"
    made = []
    for nan in ("pass", "fail"):
        folder = tmp_path / nan
        folder.mkdir()
        build_library([machine(folder, nan, text=text)], folder / "libm.so")
        made.append(re.sub(r"/\*.*?\*/|\"[^\"]*\"", "", (folder / "finite.c").read_text(), flags=re.DOTALL))
    assert made[0] == made[1]
