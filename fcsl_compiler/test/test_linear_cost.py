# SPDX-License-Identifier: Apache-2.0
"""A machine of twice as many instances costs twice as much: counts, because times depend on the computer."""

import json
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.driver.passes import Compilation, compile_machine

PI = """\
class Pi:
    inputs = {"setpoint": "f64", "measured": "f64"}
    outputs = {"command": "f64"}
    parameters = {"kp": "f64", "ki": "f64"}
    state = {"integral": "f64"}

    def execute(self):
        error = self.setpoint - self.measured
        self.integral += self.ki * error * 0.001
        self.command = self.kp * error + self.integral
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("linear")


@cache
def compiled(folder: Path, count: int) -> tuple[int, Compilation]:
    """The calls of Python functions that a chain of controllers takes, and what becomes of it."""
    (folder / "pi.py").write_text(PI)
    names = [f"pi{n}" for n in range(count)]
    config = {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {"Pi": {"source": "pi.py"}},
        "instances": {
            name: {"algorithm": "Pi", "parameters": {"kp": 1.0 + n, "ki": 2.0 + n}} for n, name in enumerate(names)
        },
        "connections": [
            {"from": f"{a}.command", "to": f"{b}.setpoint"} for a, b in zip(names, names[1:], strict=False)
        ],
        "states": {"RUN": {"schedule": dict.fromkeys(names, 1000)}},
        "transitions": [],
    }
    path = folder / f"chain{count}.json"
    path.write_text(json.dumps(config))
    calls = 0

    def counted(_: Any, event: str, __: Any) -> None:
        nonlocal calls
        calls += event == "call"

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        made = compile_machine(path, "")
    finally:
        sys.setprofile(before)
    return calls, made


def test_the_compiler_takes_linear_time(folder: Path) -> None:
    compiled(folder, 90)  # what is made once in a process
    at_100, at_200, at_400 = (compiled(folder, count)[0] for count in (100, 200, 400))
    assert at_400 - at_200 <= 2.02 * (at_200 - at_100)
    assert (at_400 - at_200) / 200 < 2500  # for each instance


def test_no_function_grows_with_the_machine(folder: Path) -> None:
    """C compilers take more than linear time for large functions."""

    def longest(count: int) -> int:
        functions = re.findall(r"^\{\n(.*?)^\}$", compiled(folder, count)[1].source, re.DOTALL | re.MULTILINE)
        return max(text.count("\n") for text in functions)

    assert longest(400) == longest(200)


def test_gcc_does_not_specialise_functions_of_large_machines(folder: Path) -> None:
    """It would take quadratic time to decide against it."""
    pragma = '#pragma GCC optimize("no-ipa-cp")'
    assert pragma in compiled(folder, 500)[1].source
    assert pragma not in compiled(folder, 100)[1].source
