# SPDX-License-Identifier: Apache-2.0
"""Arrays of thousands of values: what they cost to compile, and that they hold what they should."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_tables import kind, machine

from fcsl_compiler.driver.passes import compile_machine

__all__ = ["kind"]  # runs the tests here on both kinds of machine


def test_large_initial_values_are_copied_from_tables(tmp_path: Path) -> None:
    """C compilers take quadratic time for an assignment of each element."""
    law = (
        'class Law:\n    parameters = {"a": "f64[70][3]", "b": "f32[500]", "c": "P[40]", "d": "Deep", "e": "i64[900]"}\n'
        '    outputs = {"y": "f64"}\n    def execute(self):\n        self.y = self.a[69, 2] + f64(self.b[499]) + self.c[39].y\n'
    )
    values: dict[str, Any] = {
        "a": [[0.5 * i - 7.0 * k for k in range(3)] for i in range(70)],
        "b": [-0.0] * 499 + [2.5],
        "c": [{"x": i, "y": -i / 3} for i in range(40)],
        "d": {"u": True, "in": [{"x": i, "y": [i, -i][i % 2]} for i in range(50)]},
        "e": [0] * 900,
    }
    config = {
        "structs": {"P": {"x": "i64", "y": "f64"}, "Deep": {"u": "bool", "in": "P[50]"}},
        "instances": {"law": {"algorithm": "Law", "parameters": values}},
        "states": {"A": {"schedule": {"law": 1000}}},
    }
    m = machine(tmp_path, config, law=law)
    m.step()
    found = {name: m.get(f"law.parameters.{name}") for name in ("a", "b", "e")}
    assert np.array_equal(np.reshape(found["a"], (70, 3)), values["a"]) and found["e"] == values["e"]
    assert np.array_equal(np.signbit(found["b"]), [True] * 499 + [False]) and found["b"][499] == 2.5
    for path, expected in (("c", values["c"]), ("d.in", values["d"]["in"])):
        for i, p in enumerate(expected):
            assert (m.get(f"law.parameters.{path}[{i}].x"), m.get(f"law.parameters.{path}[{i}].y")) == (p["x"], p["y"])
    assert m.get("law.outputs.y") == values["a"][69][2] + 2.5 - 13.0
    header = compile_machine(next(tmp_path.glob("**/*.json")), "").header
    assert header.count("static const") == 4 and header.count("] = ") < 10


@pytest.mark.parametrize(
    ("body", "warned"),
    [
        ("self.values[self.head] = self.x", True),  # the index may be out of range
        ("self.values[i32(self.x)] = 1.0", True),
        ("self.values[self.count % 4096] = self.x\n        self.head = self.head + 1", True),  # it overflows behind it
        ("self.head = self.head + 1\n        self.values[self.count % 4096] = self.x", False),
        ("self.values[self.count % 4096] = self.x", False),
        ("self.small[self.head] = self.x", False),
    ],
)
def test_a_large_copy_is_told(tmp_path: Path, body: str, warned: bool) -> None:
    state = '{"values": "f64[4096]", "small": "f64[8]", "head": "i32", "count": "u32"}'
    law = f'class Law:\n    inputs = {{"x": "f64"}}\n    state = {state}\n    def execute(self):\n        {body}\n'
    config = {"instances": {"law": {"algorithm": "Law"}}, "states": {"A": {"schedule": {"law": 1000}}}}
    machine(tmp_path, config, law=law)
    found = compile_machine(next(tmp_path.glob("**/*.json")), "").sink.diagnostics
    assert [d.message for d in found if d.code == "W307"] == [
        "each run copies the 32768 bytes of `values`, so that a fault can undo what is written to it"
    ] * warned
