# SPDX-License-Identifier: Apache-2.0
"""Arrays of thousands of values: what they cost to compile, and that they hold what they should."""

import random
import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_tables import kind, machine

from fcsl_compiler.check import fault_points
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
        ("for k in range(2):\n            self.values[self.head + k] = self.x", True),  # an index may be out of range
        ("self.values = zeros(4096)\n        self.head = self.head + 1", True),  # it overflows behind it
        ("self.head = self.head + 1\n        for k in range(2):\n            self.values[k] = self.x", False),
        ("for k in range(2):\n            self.values[self.count % 4096] = self.x", False),
        ("self.values[self.head] = self.x\n        self.head = self.head + 1", False),  # one element is remembered
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


_WRITES = """
class Law:
    inputs = {"i": "i32", "k": "i32", "often": "bool", "divisor": "i32", "x": "f64"}
    outputs = {"y": "i32", "copy": "f64[64]"}
    state = {"values": "f64[64]", "rows": "f64[64][3]", "points": "P[64]", "count": "i32"}

    def execute(self):
        self.count += 1
        self.values[self.i] = self.x
        self.rows[self.k] = self.rows[self.i]
        self.rows[self.i, 1:3] = [self.x, self.x + 1.0]
        if self.often:
            self.values[self.k] = self.values[self.i] + self.values[0]
            self.points[self.i].x = self.x
            if self.x > 5.0:
                self.copy[self.k] = self.x
            self.y = 100 // self.divisor
        self.values[self.i - 1] = self.values[self.k]
        self.points[self.k].y = self.count
        self.copy[7] = self.x
        self.y = 200 // (self.divisor - 1)
        self.copy[7] = -self.x
"""


def test_a_fault_restores_the_elements_that_were_written(tmp_path: Path) -> None:
    """Against lists that are copied whole. Indices meet, so that the order of restoring matters."""
    config = {
        "structs": {"P": {"x": "f64", "y": "i32"}},
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"A": {"schedule": {"law": 1000}}},
    }
    m = machine(tmp_path, config, law=_WRITES)
    values, copy, rows = [0.0] * 64, [0.0] * 64, [[0.0] * 3 for _ in range(64)]
    points = [[0.0, 0] for _ in range(64)]
    count, faults, rng = 0, 0, random.Random(3)
    for _ in range(400):
        i, k, divisor, often = (
            rng.choice([0, 1, 2, 64]),
            rng.choice([0, 1, 63, -1]),
            rng.choice([0, 1, 2]),
            rng.random() < 0.5,
        )
        x = rng.uniform(0, 10)
        before = deepcopy((values, copy, rows, points, count))
        try:
            count += 1
            values[_at(i)] = x
            rows[_at(k)] = list(rows[i])
            rows[i][1:3] = [x, x + 1.0]
            if often:
                values[k] = values[i] + values[0]
                points[i][0] = x
                if x > 5.0:
                    copy[k] = x
                100 // divisor
            values[_at(i - 1)] = values[k]
            points[k][1] = count
            200 // (divisor - 1)
            copy[7] = -x
        except (IndexError, ZeroDivisionError):
            values, copy, rows, points, count = before
            faults += 1
        for name, value in (("i", i), ("k", k), ("divisor", divisor), ("often", often), ("x", x)):
            m.set(f"law.inputs.{name}", value)
        m.step()
        assert m.get("law.state.values") == values and m.get("law.outputs.copy") == copy
        assert m.get("law.state.rows") == [v for row in rows for v in row] and m.get("law.state.count") == count
        for n in (0, 1, 2, 63):
            assert [m.get(f"law.state.points[{n}].{name}") for name in "xy"] == points[n]
        assert m.get("law.counters.faults") == faults
    assert 100 < faults < 350


def _at(index: int) -> int:
    if not 0 <= index < 64:
        raise IndexError
    return index


def test_elements_are_remembered_and_not_the_array(tmp_path: Path) -> None:
    source = (
        'class Law:\n    inputs = {"x": "f64"}\n    state = {"values": "f64[65536]", "head": "i32"}\n    def execute(self):\n'
        "        self.values[self.head] = self.x\n        self.head = (self.head + 1) % 65536\n"
    )
    config = {"instances": {"law": {"algorithm": "Law"}}, "states": {"A": {"schedule": {"law": 1000}}}}
    machine(tmp_path, config, law=source)
    found = compile_machine(next(tmp_path.glob("**/*.json")), "")
    stack = re.search(r"\.stack_bytes = (\d+)u", found.source)
    assert stack is not None and int(stack[1]) < 2000 and not found.sink.diagnostics
    assert found.lowered is not None
    (law,) = found.lowered.instances
    assert fault_points.rollback_bytes(law.execute, law.algorithm.ports) == 8 + 4, "an element and `head`"
