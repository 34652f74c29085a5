# SPDX-License-Identifier: Apache-2.0
"""An `execute` on small constant matrices that becomes one sequence of scalar operations: the bits of CPython, whatever
the matrices, the inputs and the path through the code. Which functions are written out, and which stay as they are."""

import math
import re
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fcsl_compiler.driver.library import emit
from fcsl_compiler.emit import straight_line

FILTER = """\
class Filter:
    inputs = {"z": "f64[M]", "skip": "bool", "again": "bool"}
    outputs = {"x": "f64[N]", "gain": "f64[N][M]", "steps": "u32"}
    parameters = {"f": "f64[N][N]", "h": "f64[M][N]", "q": "f64[N][N]", "r": "f64[M][M]", "scale": "f64"}
    state = {"p": "f64[N][N]", "old": "f64[N]", "older": "f64[N]"}

    def execute(self):
        self.older = self.old
        self.old = self.x
        self.p = kf_predict_cov(self.f, self.p, self.q)
        self.x = kf_predict_state(self.f, self.x)
        if self.skip:
            return
        k = kf_gain(self.p, self.h, self.r)
        for n in range(2):
            if n == 0 or self.again:
                self.x = kf_update_state(self.x, k, self.z, self.h)
        self.p = kf_update_cov(self.p, k, self.h)
        self.gain = self.scale * k
        self.steps += 1 if self.again else 2
"""

ELEMENTS = st.sampled_from([0.0, 0.0, -0.0, 1.0, -1.0, 0.25, -3.0, 1e-3])
INPUTS = st.sampled_from([-0.0, 1.5, -2.0, 1e300, float("inf"), float("nan")])


def machine(folder: Path, text: str, n: int, m: int, parameters: dict[str, Any], frozen: Any) -> Path:
    for name, size in (("N", n), ("M", m)):
        text = re.sub(rf"\[{name}\]", f"[{size}]", text)
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "instances": {"one": {"algorithm": "Filter", "parameters": parameters, "frozen": frozen}},
        "states": {"A": {"schedule": {"one": 1}}},
    }
    return write_machine(folder, "straight", config, {"filter": text})


def body(config: Path, folder: Path) -> str:
    """The generated C of its `execute`."""
    emit([config], folder)
    source = (folder / "straight.c").read_text()
    found = re.search(r"^static void alg_Filter\w*__execute\(.*?^\}", source, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[0]


def of_model(n: int, m: int, q: float = 0.01, r: float = 0.5) -> dict[str, Any]:
    """Integrators in a row, the first ones measured."""
    model = {"f": np.eye(n) + 0.1 * np.eye(n, k=1), "h": np.eye(m, n), "q": q * np.eye(n), "r": r * np.eye(m)}
    return {name: value.tolist() for name, value in model.items()} | {"scale": 2.0}


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_bits_are_those_of_cpython(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Matrices with any zeros and ones, also such for which the gain is NaN; inputs that are not finite, too."""
    n, m = data.draw(st.integers(5, 7)), data.draw(st.integers(1, 3))
    shapes = {"f": (n, n), "h": (m, n), "q": (n, n), "r": (m, m)}
    parameters: dict[str, Any] = {"scale": 0.5}
    for name, (rows, columns) in shapes.items():
        parameters[name] = data.draw(
            st.lists(st.lists(ELEMENTS, min_size=columns, max_size=columns), min_size=rows, max_size=rows)
        )
    folder = tmp_path_factory.mktemp("straight")
    config = machine(folder, FILTER, n, m, parameters, True)
    with patch.object(straight_line, "_MOST_STATEMENTS", 5000):
        assert "for (" not in body(config, folder)
        twins = Twins(config)
    for _ in range(12):
        twins.set("one.inputs.z", data.draw(st.lists(INPUTS, min_size=m, max_size=m)))
        for name in ("skip", "again"):
            twins.set(f"one.inputs.{name}", data.draw(st.booleans()))
        twins.step()


@pytest.mark.parametrize("r", [0.5, -100.0])
def test_both_ways_out_of_the_gain(tmp_path: Path, r: float) -> None:
    """A covariance of innovations that is not positive definite makes the gain NaN: the function returns early."""
    config = machine(tmp_path, FILTER, 6, 2, of_model(6, 2, r=r), True)
    assert "for (" not in body(config, tmp_path)
    twins = Twins(config)
    twins.set("one.inputs.z", [1.0, -2.0])
    twins.step(20)
    assert np.isnan(twins.get("one.outputs.gain")).all() == (r < 0)
    assert twins.get("one.outputs.steps") == 40


SWAP = """\
class Filter:
    inputs = {"a": "f64[N][N]"}
    outputs = {"x": "f64[N]", "turned": "f64[N][N]"}
    state = {"y": "f64[N]", "p": "f64[N][N]"}

    def start(self):
        for i in range(N):
            self.x[i] = f64(i)
            self.y[i] = -f64(i)

    def execute(self):
        kept = self.x
        self.x = self.y
        self.y = kept
        self.turned = transpose(self.p)
        self.p = self.a
"""


def test_fields_that_change_places(tmp_path: Path) -> None:
    """New values are stored at the end: none of them is read as an old one."""
    config = machine(tmp_path, SWAP.replace("(N)", "(5)"), 5, 1, {}, True)
    assert "for (" not in body(config, tmp_path)
    twins = Twins(config)
    for tick in range(1, 4):
        a = [float(tick * 100 + i) for i in range(25)]
        before = twins.get("one.state.p")
        twins.set("one.inputs.a", a)
        twins.step()
        assert twins.get("one.outputs.x") == [(-1.0) ** tick * i for i in range(5)]
        assert np.array_equal(np.reshape(twins.get("one.outputs.turned"), (5, 5)), np.reshape(before, (5, 5)).T)


SIGNS = """\
class Filter:
    inputs = {"a": "f64[N][N]", "up": "bool"}
    outputs = {"x": "f64[N]", "sign": "f64", "early": "f64"}

    def execute(self):
        self.x = matvec(transpose(self.a), self.x)
        zero = -0.0
        if self.up:
            zero = 0.0
        self.sign = zero
        for i in range(N):
            if self.x[i] > 1.0:
                self.early = f64(i)
                return
            self.x[i] = 1.5
"""


def test_zeros_of_both_signs_and_a_return_from_each_iteration(tmp_path: Path) -> None:
    config = machine(tmp_path, SIGNS.replace("(N)", "(5)"), 5, 1, {}, True)
    assert "for (" not in body(config, tmp_path)
    twins = Twins(config)
    for up in (True, False):
        twins.set("one.inputs.up", up)
        twins.step(4)
        assert math.copysign(1.0, twins.get("one.outputs.sign")) == (1.0 if up else -1.0)


UNSIGNED = """\
ONE: u32 = 1
TWO: u32 = 2
BIG: u64 = 4294967296


def big(n: "u32", a: "f64[N][N]") -> "f64[N][N]":
    if n - u32(2) > u32(5):
        return transpose(a)
    return a


class Filter:
    inputs = {"a": "f64[N][N]"}
    outputs = {"x": "f64[N][N]", "wraps": "f64"}

    def execute(self):
        self.x = big(u32(1), self.a)
        if ONE - TWO > 5:
            self.wraps += 1.0
        if BIG * BIG == 0:
            self.wraps += 2.0
"""


def test_unsigned_numbers_wrap(tmp_path: Path) -> None:
    twins = Twins(machine(tmp_path, UNSIGNED, 6, 1, {}, True))
    twins.set("one.inputs.a", [float(i) for i in range(36)])
    twins.step(2)
    assert (twins.get("one.outputs.x")[1], twins.get("one.outputs.wraps")) == (6.0, 6.0)


def test_tables_that_nothing_reads_any_more_are_left_out(tmp_path: Path) -> None:
    body(machine(tmp_path, FILTER, 6, 2, of_model(6, 2), True), tmp_path)
    assert "alg_Filter__one__f" not in (tmp_path / "straight.c").read_text()


def test_many_iterations_that_may_return_stay_a_loop(tmp_path: Path) -> None:
    text = SIGNS.replace("range(N)", "range(5000)").replace("self.x[i]", "self.x[0]")
    assert "for (" in body(machine(tmp_path, text, 5, 1, {}, True), tmp_path)


#: Sizes of filters whose matrices are set at run time: sums written out, in loops of pairs, in loops.
AT_RUN_TIME = {"at_run_time": 9, "at_run_time_pairs": 6, "at_run_time_long": 15}
STAYS = {
    **dict.fromkeys(AT_RUN_TIME, (FILTER, False)),
    "an_index_at_run_time": (
        FILTER.replace("self.gain = ", "self.x[i32(self.steps % u32(3))] = 1.0\n        self.gain = "),
        True,
    ),
    "a_break": (
        FILTER.replace(
            "self.steps +=",
            "for i in range(N):\n            if self.x[i] > 3.0:\n                break\n        self.steps +=",
        ),
        True,
    ),
}


@pytest.mark.parametrize("case", STAYS)
def test_what_cannot_be_written_out_stays(tmp_path: Path, case: str) -> None:
    text, frozen = STAYS[case]
    n = AT_RUN_TIME.get(case, 6)
    config = machine(tmp_path, text.replace("range(N)", f"range({n})"), n, 2, of_model(n, 2), frozen)
    assert "fcsl_" in body(config, tmp_path)
    twins = Twins(config)
    twins.set("one.inputs.z", [1.0, -2.0])
    twins.step(5)


def test_functions_that_nothing_calls_any_more_are_left_out(tmp_path: Path) -> None:
    body(machine(tmp_path, FILTER, 6, 2, of_model(6, 2), True), tmp_path)
    assert "ldl_solve" not in (tmp_path / "straight.c").read_text()
