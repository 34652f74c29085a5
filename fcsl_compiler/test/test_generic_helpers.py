# SPDX-License-Identifier: Apache-2.0
"""Helpers for arrays of any size; defaults and keyword arguments of helpers. Compiled and in CPython."""

import random
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fcsl_test_abi import write_one_each
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine

FILTERS = '''
"""Helpers that another file imports."""

LENGTH = 5


def mean(x: "f64[n]", scale: f64 = 1.0) -> f64:
    total = 0.0
    for i in range(n):
        total += x[i]
    return total / n * scale


def shifted(x: "f64[n][m]", row: "f64[m]") -> "f64[n][m]":
    y = x
    for i in range(1, n):
        y[i] = x[i - 1]
    y[0] = row
    return y


def parts(x: "f64[n]", at: i32 = -1) -> tuple[f64, "f64[n]", i64]:
    return mean(x), x, n if at < 0 else len(x) + i64(at)


def highest(poses: "Pose[n]", fixed: "f32[LENGTH]", level: f32 = 0.1, word: Health = "nominal") -> f64:
    best = poses[0].height
    for i in range(1, n):
        best = max(best, poses[i].height)
    return best + f64(fixed[n] + level) if word == "nominal" else best
'''
LAW = """
from filters import highest, mean, parts, shifted


class Law:
    inputs = {"u": "f64[3]", "w": "f64[7]", "poses": "Pose[4]", "fixed": "f32[5]", "at": "i32"}
    outputs = {"means": "f64[3]", "copy": "f64[3]", "wide": "f64[7]", "counts": "i64[2]", "high": "f64[3]"}
    state = {"buffer": "f64[4][3]"}

    def execute(self):
        self.buffer = shifted(self.buffer, row=self.u)
        self.means = [mean(self.u), mean(self.w, 2), mean(self.buffer[2], scale=-1.5)]
        first, self.copy, self.counts[0] = parts(self.u)
        second, self.wide, self.counts[1] = parts(self.w, at=self.at)
        self.means[0] += first - second
        self.high[0] = highest(self.poses, self.fixed)
        self.high[1] = highest(self.poses, self.fixed, word=self.health)
        self.high[2] = highest(self.poses, fixed=self.fixed, level=0.7, word="failed")
"""


def twins_of(folder: Path) -> Twins:
    structs = {"Pose": {"height": "f64", "valid": "bool"}}
    files = {"filters.py": FILTERS, "law.py": LAW}
    return Twins(write_one_each(folder, files, {"Law": {"source": "law.py"}}, structs=structs))


def test_a_helper_takes_arrays_of_any_size(tmp_path: Path) -> None:
    twins, rng = twins_of(tmp_path), random.Random(7)
    rows = np.zeros((4, 3))
    for _ in range(6):
        u, w = [rng.uniform(-9, 9) for _ in range(3)], [rng.uniform(-9, 9) for _ in range(7)]
        twins.set("law.inputs.u", u)
        twins.set("law.inputs.w", w)
        twins.step()
        rows = np.vstack([u, rows[:3]])
        means = [np.mean(u) * 2 - np.mean(w), 2 * np.mean(w), -1.5 * np.mean(rows[2])]
        np.testing.assert_allclose(twins.native.get("law.outputs.means"), means, rtol=1e-12, atol=1e-12)
        assert twins.native.get("law.outputs.copy") == u and twins.native.get("law.outputs.wide") == w
        assert twins.native.get("law.outputs.counts") == [3, 7]


def test_defaults_and_keywords(tmp_path: Path) -> None:
    twins = twins_of(tmp_path)
    twins.set("law.inputs.poses[2].height", 8.0)
    twins.set("law.inputs.fixed", [0.0, 0.0, 0.0, 0.0, 2.0])
    twins.set("law.inputs.at", 4)
    twins.step()
    tenth = float(np.float32(2.0) + np.float32(0.1))
    assert twins.native.get("law.outputs.high") == [8.0 + tenth, 8.0 + tenth, 8.0]
    assert twins.native.get("law.outputs.counts") == [3, 11]


def test_a_fault_in_a_helper_of_one_size(tmp_path: Path) -> None:
    """An index may be outside for one size and inside for another."""
    source = """
def at(x: "f64[n]", i: i32) -> f64:
    return x[i]


class Law:
    inputs = {"u": "f64[2]", "w": "f64[9]", "i": "i32"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = at(self.w, self.i) + at(self.u, self.i)
"""
    twins = Twins(write_one_each(tmp_path, {"law.py": source}, {"Law": {"source": "law.py"}}))
    twins.expect([({"law.inputs.i": i}, {"law.counters.faults": max(0, i - 1)}) for i in range(4)])


def test_a_branch_for_other_sizes_is_not_checked(tmp_path: Path) -> None:
    source = """
def third(x: "f64[n]") -> f64:
    if n > 2:
        return x[2]
    elif n == 2:
        return x[1]
    return -x[0]


def nested(x: "f64[n]", on: bool) -> f64:
    if on:
        if n > 2:
            return x[2]
        return x[0] * 10.0
    return 0.5


class Law:
    inputs = {"u": "f64[1]", "v": "f64[2]", "w": "f64[m]"}
    outputs = {"y": "f64[4]", "z": "f64[4]"}

    def execute(self):
        self.y[0] = third(self.u)
        self.y[1] = third(self.v)
        self.y[2] = third(self.w)
        self.z = [nested(self.u, True), nested(self.w, True), nested(self.u, False), nested(self.w, False)]
        if m == 3 and self.u[0] > 0.0:
            self.y[3] = self.w[0]
        if m > 3:
            self.y[3] = self.w[3]
"""
    entry = {"source": "law.py", "sizes": {"m": 3}}
    twins = Twins(write_one_each(tmp_path, {"law.py": source}, {"Law": entry}))
    for name, values in (("u", [1.0]), ("v", [2.0, 3.0]), ("w", [4.0, 5.0, 6.0])):
        twins.set(f"law.inputs.{name}", values)
    twins.step()
    assert twins.native.get("law.outputs.z") == [10.0, 6.0, 0.5, 0.5]
    assert twins.native.get("law.outputs.y") == [-1.0, 3.0, 6.0, 4.0] and twins.native.get("law.counters.faults") == 0


def test_the_instructions_are_those_of_a_helper_for_this_size(tmp_path: Path) -> None:
    generic = """
from fcsl_builtins import sqrt


def rms(x: "f64[n]") -> f64:
    total = 0.0
    for i in range(n):
        total += x[i] * x[i]
    return sqrt(total / n)


class Law:
    inputs = {"u": "f64[6]"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = rms(self.u)
"""
    special = generic.replace("[n]", "[6]").replace("range(n)", "range(6)").replace("/ n)", "/ 6)")
    assert instructions(tmp_path / "generic", generic) == instructions(tmp_path / "special", special) != []


def instructions(folder: Path, source: str) -> list[str]:
    """The instructions of a machine's library, without addresses and names."""
    folder.mkdir()
    library = build_machine(write_one_each(folder, {"law.py": source}, {"Law": {"source": "law.py"}})).library
    text = subprocess.run(["objdump", "-d", "--no-show-raw-insn", library], capture_output=True, text=True, check=True)
    code = text.stdout.partition("<several_step>:")[2].partition("\n\n")[0] or text.stdout
    return [re.sub(r"\b[0-9a-f]{3,}\b|<.*>", "", line.partition("\t")[2]) for line in code.splitlines()]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("last(self.u)", "index 3 is outside [0, 3)"),
        ("pair(self.u, self.w)", "`pair`: size n is 3 in a, but 2 in b"),
        ("pair(self.u, self.single)", "`pair`: b is f64[n], not f32[3]"),
        ("pair(self.u)", "`pair` takes 2 argument(s), not 1"),
    ],
)
def test_errors_name_the_call(tmp_path: Path, call: str, message: str) -> None:
    source = f"""
def last(x: "f64[n]") -> f64:
    return x[n]


def pair(a: "f64[n]", b: "f64[n]") -> f64:
    return a[0] * b[0]


class Law:
    inputs = {{"u": "f64[3]", "w": "f64[2]", "single": "f32[3]"}}
    outputs = {{"y": "f64"}}

    def execute(self):
        self.y = {call}
"""
    with pytest.raises(DiagnosticError) as caught:
        build_machine(write_one_each(tmp_path, {"law.py": source}, {"Law": {"source": "law.py"}}))
    (found,) = caught.value.diagnostics
    assert found.message == message
    line = source.splitlines().index(f"        self.y = {call}") + 1
    assert line in [found.span.line, *(note.span.line for note in found.notes)]
    if call.startswith("last"):
        assert found.notes[0].text == "called here, with n = 3"


def test_what_is_wrong_for_these_sizes_names_them(tmp_path: Path) -> None:
    """A call of the library in a helper of another file: through all calls to the machine JSON that binds the size."""
    tools = """
def two(x: "f64[n]") -> f64:
    return dot(x, [1.0, 2.0])
"""
    law = """
from tools import two


class Law:
    inputs = {"u": "f64[m]"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = two(self.u)
"""
    files = {"law.py": law, "tools.py": tools}
    with pytest.raises(DiagnosticError) as caught:
        build_machine(write_one_each(tmp_path, files, {"Law": {"source": "law.py", "sizes": {"m": 3}}}))
    (found,) = caught.value.diagnostics
    assert found.code == "E418" and found.span.source.name == "tools.py"
    assert [(note.text, note.span.text) for note in found.notes] == [
        ("called here, with n = 3", "two(self.u)"),
        ("with m = 3 here", '"m"'),
    ]


AVERAGE = '''
"""Two sizes of one class."""


def last(x: "f64[n]") -> f64:
    return x[n - 1]


class Average:
    inputs = {"u": "f64[m]"}
    outputs = {"y": "f64", "z": "f32"}
    state = {"buffer": "f64[n][m]", "count": "i64"}

    def execute(self):
        for i in range(n - 1, 0, -1):
            self.buffer[i] = self.buffer[i - 1]
        self.buffer[0] = self.u
        self.count = min(self.count + 1, n)
        self.y = sum(self.buffer[n - 1]) / m + f64(self.count) + last(self.u)
        self.z = f32(self.y) * n
'''


def sized(folder: Path, **entries: dict[str, int]) -> Path:
    algorithms = {name: {"source": "average.py", "class": "Average", "sizes": s} for name, s in entries.items()}
    return write_one_each(folder, {"average.py": AVERAGE}, algorithms)


def test_a_class_with_two_sizes(tmp_path: Path) -> None:
    twins, rng = Twins(sized(tmp_path, Short={"n": 2, "m": 3}, Long={"n": 5, "m": 1})), random.Random(5)
    rows = {"short": np.zeros((2, 3)), "long": np.zeros((5, 1))}
    for tick in range(1, 9):
        for name in rows:
            u = [rng.uniform(-1, 1) for _ in range(rows[name].shape[1])]
            rows[name] = np.vstack([u, rows[name][:-1]])
            twins.set(f"{name}.inputs.u", u)
        twins.step()
        for name, buffer in rows.items():
            n, m = buffer.shape
            y = buffer[-1].sum() / m + min(tick, n) + buffer[0, -1]
            assert twins.native.get(f"{name}.outputs.y") == pytest.approx(y, rel=1e-12)
            assert twins.native.get(f"{name}.outputs.z") == float(
                np.float32(twins.native.get(f"{name}.outputs.y")) * np.float32(n)
            )


@pytest.mark.parametrize(
    ("sizes", "code", "message"),
    [
        ({"n": 2}, "E202", "`Short` has no size `m`"),
        ({"n": 2, "m": 3, "k": 1}, "E206", "`Average` has no size `k`"),
        ({"n": 0, "m": 1}, "E204", "size `n` is 0"),
        ({"n": 300, "m": 300}, "E301", "f64[300][300] holds 90000 scalars"),
        ({}, "E301", "`m` is not an array size"),
    ],
)
def test_wrong_sizes(tmp_path: Path, sizes: dict[str, int], code: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(sized(tmp_path, Short=sizes))
    assert [(d.code, d.message) for d in caught.value.diagnostics][0] == (code, message)
