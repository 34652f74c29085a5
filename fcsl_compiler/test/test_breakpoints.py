# SPDX-License-Identifier: Apache-2.0
"""Breakpoints: those that are known ascend; the cell of a point, of tables of every length, evenly spaced or not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

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


CELLS = """
class Cells:
    inputs = {"x": "f64", "single": "f32"}
    parameters = {"xs": "f64[n]", "singles": "f32[n]"}
    outputs = {"cell": "i64", "single_cell": "i64", "y": "f64"}

    def execute(self):
        self.cell = interp_cell(self.x, self.xs)
        self.single_cell = interp_cell(self.single, self.singles)
        self.y = interp(self.x, self.xs, self.xs)
"""


@pytest.mark.parametrize("n", [2, 17, 64, 512, 513, 900])
@pytest.mark.parametrize("spacing", ["even", "uneven", "wide"])
def test_the_cell_is_that_of_numpy(tmp_path: Path, n: int, spacing: str) -> None:
    """Of long tables the evenly spaced cell is tried first; the result is the same."""
    rng = np.random.default_rng(n)
    steps = {"even": np.full(n, 0.1), "uneven": rng.uniform(1e-3, 1.0, n), "wide": 10.0 ** rng.uniform(-3, 3, n)}[
        spacing
    ]
    xs = np.cumsum(steps) - 3.7
    singles = np.unique(xs.astype(np.float32))
    singles = np.append(
        singles, singles[-1] * np.float32(1.0) + np.arange(1, n - len(singles) + 1, dtype=np.float32) * 1e15
    )
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Cells": {"source": "cells.py", "sizes": {"n": n}}},
        "instances": {"cells": {"algorithm": "Cells", "parameters": {"xs": xs.tolist(), "singles": singles.tolist()}}},
        "states": {"A": {"schedule": {"cells": 10}}},
    }
    twins = Twins(write_machine(tmp_path, "one", config, {"cells": CELLS}))
    points = [*xs, *np.nextafter(xs, -np.inf), *rng.uniform(xs[0] - 1.0, xs[-1] + 1.0, 60), *[-1e308, 1e308, 0.0, -0.0]]
    for x in rng.permutation([*points, np.inf, -np.inf])[:200]:
        twins.set("cells.inputs.x", float(x))
        with np.errstate(over="ignore"):
            single = np.float32(x)
        twins.set("cells.inputs.single", float(single))
        twins.step()
        for path, table, at in (("cell", xs, x), ("single_cell", singles, single)):
            expected = np.clip(np.searchsorted(table, at, side="right") - 1, 0, n - 2)
            assert twins.get(f"cells.outputs.{path}") == expected, (path, x)
        assert twins.get("cells.outputs.y") == pytest.approx(np.clip(x, xs[0], xs[-1]), rel=1e-12, abs=1e-12)
    twins.set("cells.inputs.x", float("nan"))
    twins.step()
    assert twins.get("cells.outputs.cell") == 0 and np.isnan(twins.get("cells.outputs.y"))
    assert twins.get("cells.counters.faults") == 0
