# SPDX-License-Identifier: Apache-2.0
"""Programs in CPython and in the compiled machine: equal outputs, state and faults, bit for bit."""

import itertools
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import TYPES
from fcsl_test_programs import PARAMETERS, PROGRAMS, REQUESTS, STRUCTS, build
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

#: Programs without an operation that can fault.
NEVER_FAULT = ("aliasing", "shapes")


def strategy(t: str, count: int, scalar: bool, requests: int) -> st.SearchStrategy[Any]:
    def number(low: int, high: int) -> st.SearchStrategy[int]:
        return st.one_of(st.integers(-8 if low else 0, 8), st.integers(low, high), st.sampled_from([low, high]))

    scalars: dict[str, st.SearchStrategy[Any]] = {
        "bool": st.booleans(),
        "f64": st.one_of(st.floats(-10, 10), st.floats(), st.sampled_from([0.0, -0.0, 1.0, -2.5, math.nan, math.inf])),
        "f32": st.one_of(st.floats(-10, 10, width=32), st.floats(width=32)),
        "i32": number(-(2**31), 2**31 - 1),
        "i64": number(-(2**63), 2**63 - 1),
        "u32": number(0, 2**32 - 1),
        "u64": number(0, 2**64 - 1),
        "health": st.integers(0, 3),
        "request": st.integers(0, requests),
    }
    return scalars[t] if scalar else st.lists(scalars[t], min_size=count, max_size=count)


@pytest.mark.parametrize("name", PROGRAMS)
def test_program(name: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    twins = build(tmp_path_factory.mktemp(name), name, PROGRAMS[name], PARAMETERS.get(name, {}), STRUCTS, REQUESTS)
    inputs = {p: f for p, f in twins.native.fields.items() if p.startswith("one.inputs.")}
    one_tick = st.fixed_dictionaries(
        {p: strategy(TYPES[f.type], f.count, not f.rank, len(REQUESTS)) for p, f in inputs.items()}
    )
    outcomes: set[bool] = set()

    @seed(1)
    @settings(max_examples=60, database=None, suppress_health_check=list(HealthCheck))
    @given(st.lists(one_tick, min_size=1, max_size=4))
    def run(ticks: list[dict[str, Any]]) -> None:
        twins.init()
        for tick, values in enumerate(ticks):
            for path, value in values.items():
                twins.set(path, value)
            twins.step(where=f"tick {tick} of {ticks}")
            outcomes.add(twins.get("one.counters.faults") > 0)

    run()
    assert outcomes == ({False} if name in NEVER_FAULT else {False, True}), outcomes


def test_faults_are_seen_at_every_place(tmp_path: Path) -> None:
    """Faults in nested calls, in a branch, in a loop and in an index each restore everything."""
    text = """
def inner(d: i32) -> i32:
    total = 0
    for i in range(3):
        total += 6 // i64(d)
    return i32(total)
def outer(d: i32) -> "i32[3]":
    return [inner(d), 1, 2]
class Places:
    inputs = {"place": "i32"}
    outputs = {"x": "i32", "v": "i32[3]"}
    state = {"n": "i32"}

    def execute(self):
        self.n += 1
        self.x = 5
        self.v = outer(0 if self.place == 1 else 1)
        if self.place == 2 and inner(self.place - 2) > 0:
            self.x = 6
        for i in range(4):
            if i == 3 and self.place != 3:
                break
            self.v[i] = i
        self.v[self.place - 4 if self.place == 4 else i32(1 if self.place < 4 else 3)] = 8
        self.x = inner(1) if self.place != 6 else inner(0)
        self.v = self.v * i32(2147483647 if self.place == 7 else 1)
"""
    twins = build(tmp_path, "places", text)
    faults = []
    for place in range(9):
        twins.set("one.inputs.place", place)
        twins.step(where=f"place {place}")
        faults.append(twins.get("one.outputs.health") == "failed")
    assert faults == [False, True, True, True, False, True, True, True, True]


def test_what_is_proven_not_to_fault_does_not(tmp_path: Path) -> None:
    """Loop bounds prove the absence of faults, but not for wrapped values, and not beyond the bounds."""
    text = """
LOW: i32 = -2147483648
class Proofs:
    inputs = {"place": "i32"}
    outputs = {"x": "i32", "v": "i32[4]"}

    def execute(self):
        for i in range(4):
            if self.place == 0:
                self.x += i32(u32(i) - 10)
            if self.place == 1:
                self.x += i32(u32(i) * 4000000000 // 4000000000)
            if self.place == 2:
                self.x += i32(i // 2 + i % 3 - (i * i - 9))
            if self.place == 3:
                self.v[i - 1] = 1
            if self.place == 4:
                self.v[3 - i] += self.v[i // 2] + self.v[i % 4] + self.v[i ** 2 // 4] + 1
            if self.place == 5:
                self.x += LOW + i - 1
            if self.place == 6:
                self.x += -(LOW + 1 + i) - -(LOW + i)
            if self.place == 7:
                self.x = i32(u64(i) - 1)
            if self.place == 8:
                self.x = i32(7 // (i - 2))
            if self.place == 9:
                self.x = i32(7 % (i - 4))
"""
    twins = build(tmp_path, "proofs", text)
    faults = []
    for place in range(10):
        twins.set("one.inputs.place", place)
        twins.step(where=f"place {place}")
        faults.append(twins.get("one.outputs.health") == "failed")
    assert faults == [True, False, False, True, False, True, True, True, True, False]


def test_bits_of_f32_travel_unchanged(tmp_path: Path) -> None:
    text = """
class Copy:
    inputs = {"given": "f32"}
    outputs = {"x": "f32"}

    def execute(self):
        self.x = self.given
"""
    twins = build(tmp_path, "copy", text)
    for value in (0.1, -0.0, 1e-45, 3.4028235e38, math.inf):
        twins.set("one.inputs.given", value)
        twins.step()
        assert struct.pack("<f", twins.get("one.outputs.x")) == struct.pack("<f", value)


def test_every_comparison_chain(tmp_path: Path) -> None:
    """a op b op c for all pairs of operators, with shared subexpressions evaluated once."""
    symbols = ("<", "<=", ">", ">=", "==", "!=")
    pairs = list(itertools.product(symbols, symbols))
    lines = ["class Chains:", '    inputs = {"a": "f64", "b": "f64", "c": "f64"}']
    lines += [f'    outputs = {{"r": "bool[{len(pairs)}]"}}', "    def execute(self):"]
    lines += [f"        self.r[{n}] = self.a {one} self.b + 1.0 {two} self.c" for n, (one, two) in enumerate(pairs)]
    text = "\n".join(lines) + "\n"
    twins = build(tmp_path, "chains", text)
    for values in itertools.product((0.0, 1.0, 2.0, math.nan), repeat=3):
        for n, v in zip("abc", values, strict=True):
            twins.set(f"one.inputs.{n}", v)
        twins.step(where=str(values))
