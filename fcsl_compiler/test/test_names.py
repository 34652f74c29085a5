# SPDX-License-Identifier: Apache-2.0
"""Names that an engineer would choose: capitals of filters, and those of the library that a file does not use."""

from pathlib import Path
from typing import Any

from fcsl_test_tables import kind, machine

from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.emit.messages import message_definition

__all__ = ["kind"]  # runs the tests here on both kinds of machine

NAMES = """
pi = 3.25
inf: f32 = 7.5
tau = 2.0 * pi


def twice(sqrt: f64) -> f64:
    return sqrt * 2.0


class Law:
    inputs = {"z": "f64"}
    outputs = {"sum": "f64", "tan": "f64", "single": "f32"}

    def execute(self):
        norm = self.z
        nan = 2.0 * pi
        for clamp in range(3):
            norm += f64(clamp)
        self.sum = norm + nan + twice(self.z)
        self.tan = tan(self.z) + tau
        self.single = inf
"""
CAPITALS = """
class Law:
    inputs = {"z": "f64"}
    outputs = {"P": "f64[2][2]", "K": "f64", "qDot": "f64", "best": "Estimate"}
    parameters = {"Q": "f64"}

    def execute(self):
        self.K = self.z * self.Q
        self.P[0, 1] += self.K
        self.qDot = self.z
        self.best.R = self.K
"""


def config(**more: Any) -> dict[str, Any]:
    return {"instances": {"law": {"algorithm": "Law"}}, "states": {"A": {"schedule": {"law": 1000}}}, **more}


def test_names_of_the_library_that_a_file_does_not_use(tmp_path: Path) -> None:
    m = machine(tmp_path, config(), law=NAMES)
    m.set("law.inputs.z", 1.0)
    m.step()
    assert m.get("law.outputs.sum") == 1.0 + 3.0 + 6.5 + 2.0
    assert m.get("law.outputs.tan") == 1.5574077246549023 + 6.5
    assert m.get("law.outputs.single") == 7.5


def test_capitals_are_kept_in_paths_and_lowered_in_messages(tmp_path: Path) -> None:
    instances = {"law": {"algorithm": "Law", "parameters": {"Q": 2.0}}}
    structs = {"Estimate": {"R": "f64", "age": "f64"}}
    m = machine(tmp_path, config(instances=instances, structs=structs), law=CAPITALS)
    m.set("law.inputs.z", 1.5)
    m.step(2)
    assert [m.get(f"law.outputs.{name}") for name in ("K", "qDot", "best.R")] == [3.0, 1.5, 3.0]
    compiled = compile_machine(next(tmp_path.glob("**/*.json")), "").machine
    assert compiled is not None
    text = message_definition(compiled, compiled.instances[0])
    fields = [line.split("#")[0].split()[1] for line in text.splitlines() if line.startswith(("float64", "m/", "Est"))]
    assert {"p", "k", "qdot", "r", "age"} <= set(fields) and text == text.replace(" P ", " p ")
