# SPDX-License-Identifier: Apache-2.0
"""Types of literals and locals from their context; parts of values without a name. Compiled and in CPython."""

import struct
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_one_each
from fcsl_test_twins import Twins

from fcsl_compiler.driver.dump import dump_types
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model.literals import decimal_f32

PORTS = """
class Law:
    inputs = {
        "x": "f64", "s": "f32", "i": "i32", "n": "i64", "u": "u32", "on": "bool",
        "v": "f64[3]", "q": "f64[4]", "m": "f64[2][3]", "p": "Pose",
    }
    outputs = {
        "y": "f64", "f": "f32", "k": "i32", "l": "i64", "w": "u32", "ok": "bool",
        "a": "f64[3]", "b": "f32[3]", "c": "f64[2][3]",
    }
"""
HELPERS = """
ROOT = sqrt(2.0)
THIRD = 1 / 3
FLAG = 1 << 4
HUGE = 3000000000
TENTH = 0.1
TURN = 2 * pi


def gains(x: f64) -> "f64[3]":
    return [x, 2 * x, 3 * x]


def moved(x: f64) -> Pose:
    return Pose(gains(x), 1 < x)
"""
STRUCTS = {"Pose": {"position": "f64[3]", "valid": "bool"}}


def write(folder: Path, body: str) -> Path:
    lines = "".join(f"        {line}\n" for line in body.split("\n"))
    files = {"law.py": f"{HELPERS}\n{PORTS}\n    def execute(self):\n{lines}"}
    return write_one_each(folder, files, {"Law": {"source": "law.py"}}, structs=STRUCTS)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("t = 0\nself.y = t", {"t": "f64"}),
        ("t = 0\nself.k = t", {"t": "i32"}),
        ("t = 0\nself.l = t", {"t": "i64"}),
        ("t = 0", {"t": "i64"}),
        ("t = 0.0", {"t": "f64"}),
        ("t = sin(1)", {"t": "f64"}),
        ("t = sqrt(2)", {"t": "f64"}),
        ("t = 0\nt += self.s", {"t": "f32"}),
        ("t = 0\nif self.on:\n    t = self.i", {"t": "i32"}),
        ("t = 1 if self.on else 0.5", {"t": "f64"}),
        ("t = 1\nu = t * 2\nself.f = u", {"t": "f32", "u": "f32"}),
        ("t = 0\nself.ok = t < self.u", {"t": "u32"}),
        ("t = 1 << 3\nself.w = self.w | t", {"t": "u32"}),
        ("t = 1 << self.u", {"t": "u32"}),
        ("for j in range(3):\n    t = j >> self.u", {"t": "i64"}),
        ("t = 2 ** self.x", {"t": "f64"}),
        ("t = 3\nself.y = f64(t)", {"t": "i64"}),
        ("t = 3\nself.y = self.v[t % 3]", {"t": "i64"}),
        ("t = min(1, 2)\nself.f = t", {"t": "f32"}),
        ("t = [0, 1, 2]\nself.b = t", {"t": "f32[3]"}),
        ("t = THIRD\nself.f = t", {"t": "f32"}),
        ("t, u = 0, 1\nself.k = t\nself.f = u", {"t": "i32", "u": "f32"}),
        ("for j in range(3):\n    t = j\n    self.k = t", {"t": "i32"}),
        ("t = len(self.v)\nself.k = t", {"t": "i32"}),
        ("t = gains(1)", {"t": "f64[3]"}),
        ("t, u = [self.i, 0.5]", {"t": "i32", "u": "f64"}),
        ("t, u, w = gains(1)", {"t": "f64", "u": "f64", "w": "f64"}),
        ("t = moved(1)", {"t": "Pose"}),
        ("t: u64 = 1\nu = t + 1", {"t": "u64", "u": "u64"}),
    ],
)
def test_locals(tmp_path: Path, body: str, expected: dict[str, str]) -> None:
    """`fcsl build --dump types`."""
    found = dump_types(compile_machine(write(tmp_path, body), "", until="check").checked)
    lines = found.split("\n")
    first = next(n for n, line in enumerate(lines) if "execute()" in line) + 1
    assert dict(line.strip().split(": ") for line in lines[first:] if line.startswith("  ")) == expected


def f32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


INPUTS = {
    "x": 1.5,
    "s": 0.3,
    "i": 1,
    "n": 7,
    "u": 5,
    "on": True,
    "v": [1.0, 2.0, 4.0],
    "q": [0.5**0.5, 0.5**0.5, 0.0, 0.0],
}


@pytest.mark.parametrize(
    ("body", "field", "value"),
    [
        ("self.y = 1 / 3 * self.x", "y", 1 / 3 * 1.5),
        ("self.y = THIRD", "y", 1 / 3),
        ("self.f = THIRD", "f", f32(1 / 3)),
        ("self.f = TENTH + 0.2", "f", f32(f32(0.1) + f32(0.2))),
        ("self.f = 1.00000005960464477540", "f", 1.0 + 2.0**-23),
        ("self.f = f32(1.00000005960464477540)", "f", 1.0 + 2.0**-23),
        ("self.f = ROOT", "f", f32(f32(2.0) ** 0.5)),
        ("self.y = TURN / 4", "y", 2 * 3.141592653589793 / 4),
        ("self.w = FLAG | 1", "w", 17),
        ("self.w = HUGE", "w", 3000000000),
        ("self.k = HUGE - 2999999999", "k", 1),
        ("self.ok = self.u > (9007199254740993 & 65535)", "ok", True),  # only the value of literals alone must fit
        ("self.l = self.n + (2 << 31)", "l", 2**32 + 7),
        ("self.y = 7 // 2", "y", 3.0),
        ("self.k = -7 // 2", "k", -4),
        ("self.y = -0", "y", 0.0),
        ("self.y = 2 ** self.x", "y", 2**1.5),
        ("self.w = 1 << self.u", "w", 32),
        ("self.y = self.x / len(self.v)", "y", 0.5),
        ("for j in range(2, 3):\n    self.y = self.v[j >> (self.u + 40)]", "y", 1.0),
        ("for j in range(2, 3):\n    self.y = self.v[(j + 1) >> (self.u - 4)]", "y", 2.0),
        ("for j in range(len(self.v) - 1):\n    self.l += j + len(self.m)", "l", 5),
        ("self.y = gains(self.x)[2]", "y", 4.5),
        ("self.y = gains(self.x)[self.i]", "y", 3.0),
        ("self.y = gains(self.x)[1] if self.on else gains(0)[9 % 3]", "y", 3.0),
        ("self.y = moved(self.x).position[len(self.v) - 1]", "y", 4.5),
        ("self.ok = moved(self.x).valid and gains(self.x)[self.i] > 2", "ok", True),
        ("self.y = [1, 2, 4][self.i]", "y", 2.0),
        ("self.y = (self.v if self.on else gains(1))[2]", "y", 4.0),
        ("self.a[0:2] = gains(self.x)[1:3]", "a", [3.0, 4.5, 0.0]),
        ("self.c = [self.v, gains(1)]", "c", [1.0, 2.0, 4.0, 1.0, 2.0, 3.0]),
        ("self.c = [gains(self.x), [0, ROOT, 1]]", "c", [1.5, 3.0, 4.5, 0.0, 2.0**0.5, 1.0]),
        ("self.c = [self.m[self.i], self.c[0]]\nself.c = [self.c[1], self.v]", "c", [0.0, 0.0, 0.0, 1.0, 2.0, 4.0]),
        ("t, u, w = gains(self.x)\nself.y = t + u * w", "y", 1.5 + 3.0 * 4.5),
        ("t, u = [self.i, 0.5]\nself.y = f64(t) + u", "y", 1.5),
        ("self.a[0], self.y, self.a[2] = cross3(self.v, gains(1))", "a", [-2.0, 0.0, 0.0]),
        ("self.ok = quat_to_euler(self.q)[0] > 1.57", "ok", True),
    ],
)
def test_values(tmp_path: Path, body: str, field: str, value: Any) -> None:
    twins = Twins(write(tmp_path, body))
    for name, given in INPUTS.items():
        twins.set(f"law.inputs.{name}", given)
    twins.step()
    assert twins.get("law.counters.faults") == 0 and twins.get(f"law.outputs.{field}") == value


def test_a_part_of_a_call_faults_like_another(tmp_path: Path) -> None:
    """Outside its array, and only if it is evaluated."""
    twins = Twins(write(tmp_path, "self.y = gains(self.x)[self.i] if self.on else 1\nself.l = self.n"))
    twins.expect(
        [
            ({"law.inputs.i": 3, "law.inputs.n": 4}, {"law.outputs.l": 4, "law.counters.faults": 0}),
            ({"law.inputs.on": True, "law.inputs.n": 5}, {"law.outputs.l": 4, "law.counters.faults": 1}),
            ({"law.inputs.i": -1}, {"law.counters.faults": 2}),
            ({"law.inputs.i": 2}, {"law.counters.faults": 2, "law.outputs.l": 5}),
        ]
    )


@pytest.mark.parametrize("text", ["0.1", "1.00000005960464477540", "1.00000005960464477538", "16777217.0000000001"])
def test_a_decimal_literal_of_f32_is_rounded_once(text: str) -> None:
    found = decimal_f32(text)
    bits = struct.unpack("<I", struct.pack("<f", found))[0]
    near = [struct.unpack("<f", struct.pack("<I", bits + n))[0] for n in (-1, 0, 1)]
    assert min(near, key=lambda x: abs(Fraction(x) - Fraction(text))) == found
