# SPDX-License-Identifier: Apache-2.0
"""Reports of mypy for algorithm files with fcsl_builtins.mypy_plugin."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1]
ROOT = SOURCES.parent

#: Checks files with the plugin. Returns mypy's report as `file:line: message [code]`.
Check = Callable[..., list[str]]


@pytest.fixture(scope="module")
def check(tmp_path_factory: pytest.TempPathFactory) -> Check:
    """mypy with one cache for the whole module: reading its stubs takes most of a run."""
    folder = tmp_path_factory.mktemp("mypy")
    config, cache = folder / "mypy.ini", folder / "cache"
    config.write_text("[mypy]\nplugins = fcsl_builtins.mypy_plugin\n")
    path = os.pathsep.join([str(SOURCES), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
    environment = {**os.environ, "PYTHONPATH": path, "MYPYPATH": str(SOURCES)}

    def run(cwd: Path, *arguments: str) -> list[str]:
        options = [f"--config-file={config}", f"--cache-dir={cache}", "--no-error-summary", *arguments]
        command = [sys.executable, "-m", "mypy", *options]
        done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, check=False)
        assert done.returncode in (0, 1) and not done.stderr, done.stdout + done.stderr
        return [re.sub(r": (error|note)", "", line.replace("  [", " [")) for line in done.stdout.splitlines()]

    return run


def numbered(text: str, part: str) -> int:
    """Number of the line that contains `part`."""
    return next(n for n, line in enumerate(text.splitlines(), 1) if part in line)


GOOD = '''"""What a file may hold."""
from __future__ import annotations

from typing import ClassVar

from frames import turned

from fcsl_builtins import Health, bool, clamp, extern, f64, i32, isfinite, quat_to_euler, sqrt, u32, zeros

N = 3
LIMIT = sqrt(2.0)
UP: "f64[N]" = [0.0, 0.0, 1.0]
TWO = [[1.0, 0.0], [0.0, 1.0]]


@extern(header="cpu_temp.h")
def cpu_temp(channel: u32, where: Pose) -> f64:
    """Degrees."""


@extern(header="motor.h", lang="c")
def motor(speed: "f64[3]") -> None: ...


def worse(h: Health, flags: "bool[2]") -> Health:
    return "failed" if h == "stale" and flags[0] else h


def corner(m: "f64[3][3]", n: f64[2][3]) -> tuple[f64, "f64[3][3]"]:
    rows = [[1.0, 2.0], [3.0, 4.0]]
    last = [1.0, 2.0] * 2.0 if rows[0, 1] > 0.0 else [0.0, 0.0]
    return m[0, 0] + rows[0][1] + last[1], m


class Damper:
    """Every kind of port."""

    inputs = {
        "rate": "f64 rad/s",  # measured
        "nav_health": "Health",
        "q": "f64[4]",
        "pose": "Pose",
    }
    outputs: dict[str, str] = {"torque": "f64[3] N*m", "busy": "bool", "transition_request": "TransitionRequest", "m": "f64[2][2]"}
    parameters: ClassVar[dict[str, str]] = {"gain": "f64 N*m*s in 0..", "pin": "u32", "on_done": "TransitionRequest"}
    state: "dict[str, str]" = {"ticks": "i64", "held": "Pose"}

    def start(self):
        self.ticks = 0

    def execute(self):
        total = 0
        for i in range(3):
            self.torque[i] = clamp(-self.gain * self.rate, -LIMIT, LIMIT) + UP[i]
            total += self.rate
        self.torque = turned(self.torque) * 2.0 + [1.0, 0.0, total]
        self.m = TWO
        self.m[0, 1] = corner(zeros(3, 3), zeros(2, 3))[0]
        roll, pitch, yaw = quat_to_euler(self.q)
        self.held = Pose(position=[roll, pitch, yaw], frame=Frame(1))
        self.ticks = self.ticks + 1 if self.busy else 0
        self.busy = isfinite(cpu_temp(self.pin, self.pose)) and self.pose.valid
        motor(self.torque)
        self.transition_request = "DETUMBLED" if self.ticks > 100 else self.on_done
        if self.nav_health != "nominal" or self.health == "stale":
            self.health = worse(self.nav_health, [True, i32(self.rate) > 0])


class Source:
    outputs = {"rate": "f64 rad/s"}

    def execute(self) -> None: ...
'''

HELPERS = """from fcsl_builtins import f64


def turned(v: "f64[3]") -> "f64[3]":
    return [v[1], -v[0], v[2]]


def placed(pose: "Pose[2]", at: Pose) -> Pose:
    return pose[0]
"""


@pytest.mark.parametrize("options", [(), ("--check-untyped-defs",), ("--strict",)], ids=" ".join)
def test_a_right_file_is_clean(tmp_path: Path, check: Check, options: tuple[str, ...]) -> None:
    (tmp_path / "damper.py").write_text(GOOD)
    (tmp_path / "frames.py").write_text(HELPERS)
    assert check(tmp_path, *options, "damper.py") == []


ALGORITHM = """class Damper:
    inputs = {"rate": "f64 rad/s", "level": "u32"}
    outputs = {"torque": "f64 N*m", "words": "u32[4]", "busy": "bool"}
    parameters = {"gain": "f64"}
    state = {"mode": "Health", "count": "i32"}

    def start(self):
        self.count = 0

    def execute(self):
        self.torque = self.gain * self.rate
"""


MISTAKES = {
    "self.torque = self.rat": '"Damper" has no attribute "rat"; maybe "rate"? [attr-defined]',
    "self.torqe = 1.0": '"Damper" has no attribute "torqe"; maybe "torque"? [attr-defined]',
    "self.torque, self.q = 1.0, 2.0": '"Damper" has no attribute "q" [attr-defined]',
    "self.word[0] = 1": '"Damper" has no attribute "word"; maybe "words"? [attr-defined]',
    "self.transition_request = 'GO'": '"Damper" has no attribute "transition_request" [attr-defined]',
    "self.rate = 1.0": 'Property "rate" defined in "Damper" is read-only [misc]',
    "self.gain += 1.0": 'Property "gain" defined in "Damper" is read-only [misc]',
    "self.count = self.rate": '(expression has type "float", variable has type "int") [assignment]',
    "self.torque = 'much'": '(expression has type "str", variable has type "float") [assignment]',
    "self.busy = self.level": '(expression has type "int", variable has type "bool") [assignment]',
    "self.busy = 1": '(expression has type "int", variable has type "bool") [assignment]',
    "self.health = 'fine'": "(expression has type \"Literal['fine']\", variable has type \"Literal['nominal', ",
    "self.mode = 1": '(expression has type "Literal[1]", variable has type "Literal[',
    "self.torque = undefined": 'Name "undefined" is not defined [name-defined]',
}


def test_mistakes_are_found_with_their_lines(tmp_path: Path, check: Check) -> None:
    text = ALGORITHM + "".join(f"        {line}\n" for line in MISTAKES)
    (tmp_path / "damper.py").write_text(text)
    found = sorted(check(tmp_path, "damper.py"))
    assert len(found) == len(MISTAKES), found
    for line, (mistake, message) in zip(found, MISTAKES.items(), strict=True):
        assert line.startswith(f"damper.py:{numbered(text, mistake)}: ") and message in line, line


def test_empty_dictionaries_are_as_good_as_none(tmp_path: Path, check: Check) -> None:
    text = 'class A:\n    inputs = {}\n    state = {}\n    outputs = {"x": "f64"}\n\n    def execute(self):\n        self.x = 1.0\n'
    (tmp_path / "a.py").write_text(text)
    assert check(tmp_path, "--strict", "a.py") == []


def test_start_is_checked(tmp_path: Path, check: Check) -> None:
    (tmp_path / "damper.py").write_text(ALGORITHM.replace("self.count = 0", "self.coumt = 0"))
    assert check(tmp_path, "damper.py") == [
        'damper.py:8: "Damper" has no attribute "coumt"; maybe "count"? [attr-defined]'
    ]


OTHERS = """from dataclasses import dataclass

TABLE = [1.0, 2.0]


class Command:
    outputs = {"a": "f64"}

    def __init__(self) -> None:
        self.own = 1
        self.inputs: list[int] = []

    def undone(self) -> None:
        self.a


class Derived(Command):
    inputs = {"b": "f64"}  # type: ignore[assignment]

    def execute(self) -> None:
        self.later = 2
        self.b


@dataclass
class Record:
    state: dict[str, str]

    def execute(self) -> None:
        self.state["x"] = "y"
        self.x


def unchecked(x):
    return x.anything + TABLE["no"]


def wrong() -> float:
    return TABLE[0, 1]
"""


def test_other_classes_and_files_are_left_alone(tmp_path: Path, check: Check) -> None:
    (tmp_path / "others.py").write_text(OTHERS)
    found = check(tmp_path, "others.py")
    for part in ("self.a", "self.b", "self.x", "TABLE[0, 1]"):
        assert any(line.startswith(f"others.py:{numbered(OTHERS, part)}: ") for line in found), part
    assert {line.split(":")[1] for line in found} == {
        str(numbered(OTHERS, part)) for part in ("self.a", "self.b", "self.x", "TABLE[0, 1]")
    }


def test_ports_are_known_to_files_that_import_a_class(tmp_path: Path, check: Check) -> None:
    (tmp_path / "damper.py").write_text(ALGORITHM)
    (tmp_path / "use.py").write_text("from damper import Damper\n\nreveal_type(Damper().torque)\n")
    for again in ("", "Damper().gain = 1.0\n"):  # the second run reads the class from mypy's cache
        with (tmp_path / "use.py").open("a") as file:
            file.write(again)
        found = check(tmp_path, "use.py")
        assert found[0] == 'use.py:3: Revealed type is "float"', found
    assert found[1:] == ['use.py:4: Property "gain" defined in "Damper" is read-only [misc]']


@pytest.mark.parametrize(
    "folder", sorted(ROOT.glob("examples/**/algorithms")), ids=lambda folder: str(folder.relative_to(ROOT))
)
def test_examples_are_clean(folder: Path, check: Check) -> None:
    assert check(folder, "--strict", *sorted(file.name for file in folder.glob("*.py"))) == []
