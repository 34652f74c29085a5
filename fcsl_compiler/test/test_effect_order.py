# SPDX-License-Identifier: Apache-2.0
"""External calls inside expressions have the same time, order and arguments as in Python.

Every body of fcsl_test_programs.OUTSIDE runs in the compiled machine, in PyTwin and, unmodified, in plain CPython.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import write_machine
from fcsl_test_programs import OUTSIDE, STRUCTS, build, outside
from fcsl_test_twins import Twins
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

Log = list[tuple[Any, ...]]


def board(readings: list[int], log: Log) -> dict[str, Callable[..., Any]]:
    """Hardware with a sequence of readings that records its calls."""

    def read(name: str, number: int) -> int:
        log.append((name, number))
        return readings[len(log) % len(readings)]

    def write(name: str, number: int, value: Any) -> None:
        log.append((name, number, value))

    return {
        "read_gpio": lambda pin: read("gpio", int(pin)) > 1,
        "read_adc": lambda channel: read("adc", int(channel)),
        "read_u32": lambda address: read("u32", int(address)),
        "write_gpio": lambda pin, level: write("gpio", int(pin), bool(level)),
        "write_u32": lambda address, value: write("u32", int(address), int(value)),
    }


def plainly(body: str, inputs: dict[str, Any], readings: list[int]) -> tuple[Log, SimpleNamespace | None]:
    """The statements in CPython with its own numbers: their calls, and `self` after them, or None after a fault."""
    log: Log = []

    def unsigned(x: int) -> int:
        if x < 0:
            raise IndexError
        return int(x)

    def goal(place: Any = None, speed: float = 0.0) -> SimpleNamespace:
        return SimpleNamespace(place=np.array(place or [0.0, 0.0, 0.0], dtype=object), speed=speed)

    names: dict[str, Any] = {f"hw_{name}": function for name, function in board(readings, log).items()}
    names |= {
        "i32": int,
        "u32": unsigned,
        "f64": float,
        "Goal": goal,
        "dot": lambda a, b: sum(x * y for x, y in zip(a, b, strict=True)),
    }
    exec("def ratio(a: int, b: int) -> int:\n    return int(a) // b\n", names)
    body = body.replace("][", ", ")  # equivalent in the language
    exec("def execute(self):\n" + "".join(f"    {line}\n" for line in body.split("\n")), names)
    self = SimpleNamespace(
        **{**inputs, "n": 0, "w": 1, "b": False, "r": [0, 0], "y": 0.0, "health": "nominal"},
        t=np.array([1, 2, 0], dtype=object),
        m=np.array([[1, 2], [3, 4]], dtype=object),
        goals=[goal(), goal([1.0, 2.0, 3.0], 2.5)],
    )
    try:
        names["execute"](self)
    except (IndexError, ZeroDivisionError, AssertionError):
        return log, None
    return log, self


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Twins:
    return build(tmp_path_factory.mktemp("outside"), "outside", outside(), structs=STRUCTS)


@pytest.mark.parametrize("name", OUTSIDE)
def test_calls_are_those_of_cpython(name: str, twins: Twins) -> None:
    number = list(OUTSIDE).index(name)
    seen: set[bool] = set()

    @seed(1)
    @settings(max_examples=40, database=None, suppress_health_check=list(HealthCheck))
    @given(st.integers(0, 3), st.integers(0, 2), st.booleans(), st.lists(st.integers(0, 3), min_size=7, max_size=7))
    def run(i: int, d: int, on: bool, readings: list[int]) -> None:
        inputs = {"i": i, "d": d, "on": on}
        native: Log = []
        python: Log = []
        twins.native.use_hardware(board(readings, native))
        twins.python.use_hardware(board(readings, python))
        twins.init()
        for port, value in {"which": number, **inputs}.items():
            twins.set(f"one.inputs.{port}", value)
        twins.step(where=f"{inputs}, readings {readings}")
        log, self = plainly(OUTSIDE[name], inputs, readings)
        seen.add(self is None)
        assert native == log and python == log, f"{inputs}, readings {readings}"
        assert twins.get("one.counters.faults") == (self is None)
        if self is not None:
            for path in ("outputs.n", "outputs.w", "outputs.b", "outputs.r", "outputs.y", "outputs.health"):
                assert np.array_equal(twins.get(f"one.{path}"), getattr(self, path.split(".")[1])), path
            assert twins.get("one.state.t") == list(self.t)
            assert twins.get("one.state.m") == list(np.ravel(np.array(self.m, dtype=object)))
            for n, goal in enumerate(self.goals):
                assert twins.get(f"one.state.goals[{n}].place") == list(goal.place)
                assert twins.get(f"one.state.goals[{n}].speed") == goal.speed

    run()
    assert False in seen, "it always faults"


def test_some_of_them_fault() -> None:
    """The bodies combine calls with expressions that may fault at every position."""
    faulting = [name for name, body in OUTSIDE.items() if "// self" in body or "[self.i" in body or "[hw_" in body]
    assert len(faulting) > len(OUTSIDE) // 2


# ---- externs -----------------------------------------------------------------------------------------------------------

HEADER = """\
#include <stdbool.h>
#include <stdint.h>
int32_t probe(int32_t a);
void put(const int32_t *rows);
void bend(const calls_Goal_t *goal, int32_t k, calls_Goal_t *bent);
void mixed(bool on, const calls_Goal_t *goals, const double *place, float f);
void grid(int32_t k, int32_t *rows);
void recorded(double *calls);
"""

SOURCE = """\
#include "calls.h"
#include "outside.h"
#include <string.h>

static double log_[24];
static int count;

static void note(double x)
{
    if (count < 24) {
        log_[count++] = x;
    }
}

int32_t probe(int32_t a)
{
    note(100 + a);
    return a;
}

void put(const int32_t *rows)
{
    note(200);
    for (int i = 0; i < 6; ++i) {
        note(rows[i]);
    }
}

void bend(const calls_Goal_t *goal, int32_t k, calls_Goal_t *bent)
{
    note(300 + k);
    note(goal->speed);
    *bent = *goal;
    bent->place[k] += 10.0;
}

void mixed(bool on, const calls_Goal_t *goals, const double *place, float f)
{
    note(400 + on);
    note(goals[1].speed);
    note(place[2]);
    note(f);
}

void grid(int32_t k, int32_t *rows)
{
    note(500 + k);
    for (int i = 0; i < 6; ++i) {
        rows[i] = k * i;
    }
}

void recorded(double *calls)
{
    memcpy(calls, log_, sizeof log_);
    memset(log_, 0, sizeof log_);
    count = 0;
}
"""

#: Statements, and their calls with i = 1 and d = 2; with i = 5; and with d = 0.
CALLS: dict[str, tuple[str, list[float], list[float], list[float]]] = {
    "an array": ("put(self.cube[self.i])", [200, 6, 7, 8, 9, 10, 11], [], [200, 6, 7, 8, 9, 10, 11]),
    "a made array": (
        "put([[probe(1), 2, probe(3)], [4, 6 // self.d, probe(6)]])",
        [101, 103, 106, 200, 1, 2, 3, 4, 3, 6],
        [101, 103, 106, 200, 1, 2, 3, 4, 3, 6],
        [101, 103],
    ),
    "an array that is computed": (
        "put(self.cube[0] + self.cube[self.i])",
        [200, 6, 8, 10, 12, 14, 16],
        [],
        [200, 6, 8, 10, 12, 14, 16],
    ),
    "a struct": ("self.goal = bend(self.goals[self.i], 1)", [301, 2.5], [], [301, 2.5]),
    "a struct and an argument behind it": (
        "self.goal = bend(self.goals[self.i], probe(2))",
        [102, 302, 2.5],
        [],
        [102, 302, 2.5],
    ),
    "a made struct": (
        "self.goal = bend(Goal([1.0, 2.0, 3.0], f64(6 // self.d)), probe(0))",
        [100, 300, 3.0],
        [100, 300, 3.0],
        [],
    ),
    "a target that faults": ("self.goals[self.i] = bend(self.goals[1], 2)", [302, 2.5], [302, 2.5], [302, 2.5]),
    "a target that is called": (
        "self.goals[probe(self.i)] = bend(self.goals[1], 6 // self.d - 2)",
        [301, 2.5, 101],
        [301, 2.5, 105],
        [],
    ),
    "elements": (
        "mixed(self.i < self.d, self.goals, self.goals[self.i].place, 0.5)",
        [401, 2.5, 3.0, 0.5],
        [],
        [400, 2.5, 3.0, 0.5],
    ),
    "arrays as results": (
        "self.rows = grid(probe(self.i) + 1)\nself.n = self.rows[1][2] + probe(7) // self.d",
        [101, 502, 107],
        [105, 506, 107],
        [101, 502, 107],
    ),
    "an array in an expression": (
        "self.rows = grid(1) + self.cube[self.i] * probe(2)",
        [501, 102],
        [501],
        [501, 102],
    ),
    "a slice": ("self.rows[0] = [probe(1), self.cube[self.i][0, 1], probe(2)]", [101, 102], [101], [101, 102]),
    "a condition": (
        "if probe(self.i) > probe(self.d) and self.d > 0:\n    put(self.rows)\nelif probe(3) == 3:\n    self.n = probe(4)",
        [101, 102, 103, 104],
        [105, 102, 200, 0, 0, 0, 0, 0, 0],
        [101, 100, 103, 104],
    ),
}

CALLER = '''
from fcsl_builtins import extern, f32, f64, i32


@extern(header="outside.h")
def probe(a: i32) -> i32: ...


@extern(header="outside.h", lang="c")
def put(rows: "i32[2][3]") -> None:
    """Shows them."""


@extern(header="outside.h")
def bend(goal: "Goal", k: i32) -> "Goal": ...


@extern(header="outside.h")
def mixed(on: bool, goals: "Goal[2]", place: "f64[3]", f: f32) -> None:
    """Four arguments."""
    ...


@extern(header="outside.h")
def grid(k: i32) -> "i32[2][3]": ...


@extern(header="outside.h")
def recorded() -> "f64[24]": ...


class Caller:
    inputs = {"which": "i32", "i": "i32", "d": "i32"}
    outputs = {"n": "i32", "rows": "i32[2][3]", "goal": "Goal"}
    state = {"cube": "i32[2][2][3]", "goals": "Goal[2]"}

    def start(self):
        self.cube = [[[0, 1, 2], [3, 4, 5]], [[6, 7, 8], [9, 10, 11]]]
        self.goals[1] = Goal([1.0, 2.0, 3.0], 2.5)

    def execute(self):
BODY

class Reader:
    """What was called since the last tick, though its caller may have faulted."""

    inputs = {"after": "Health"}
    outputs = {"calls": "f64[24]"}

    def execute(self):
        self.calls = recorded()
'''


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Twins:
    folder = tmp_path_factory.mktemp("calls")
    lines = []
    for number, (body, *_) in enumerate(CALLS.values()):
        lines += [f"        if self.which == {number}:", *(f"            {line}" for line in body.split("\n"))]
    (folder / "outside.h").write_text(HEADER)
    (folder / "outside.c").write_text(SOURCE)
    config = {
        "tick_hz": 1,
        "initial_state": "A",
        "structs": {"Goal": STRUCTS["Goal"]},
        "instances": {"reader": {"algorithm": "Reader"}, "one": {"algorithm": "Caller"}},
        "connections": [{"from": "one.health", "to": "reader.after"}],
        "states": {"A": {"schedule": {"one": 1, "reader": 1}}},
        "targets": {"simulation": {"sources": ["outside.c"], "include": ["."]}},
    }
    return Twins(write_machine(folder, "calls", config, {"caller": CALLER.replace("BODY", "\n".join(lines) + "\n")}))


@pytest.mark.parametrize("name", CALLS)
def test_externs_are_not_called_after_a_fault(name: str, calls: Twins) -> None:
    """Arrays and structs as arguments and results: a fault in an argument, or to the left of the call, prevents it."""
    number = list(CALLS).index(name)
    for (i, d), expected in zip([(1, 2), (5, 2), (1, 0)], CALLS[name][1:], strict=True):
        calls.init()
        for port, value in (("which", number), ("i", i), ("d", d)):
            calls.set(f"one.inputs.{port}", value)
        calls.step(where=f"i = {i}, d = {d}")
        assert calls.get("reader.outputs.calls") == [*expected, *[0.0] * (24 - len(expected))], f"i = {i}, d = {d}"


# ---- what the C compiler makes of it -----------------------------------------------------------------------------------
