# SPDX-License-Identifier: Apache-2.0
"""Machines to step tick by tick against tables written by hand: compiled ones, and CPython's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import InReference

# Says what the host tells it to: an echo of requests, health and faults, and a count of its runs.
PUPPET = """
class Inputs:
    ask: "i32"     # 1: GO, 2: HALT
    ill: "i32"     # 1: degraded, 2: failed
    divisor: "i32"

class Outputs:
    runs: "i32"
    quotient: "i32"

class State:
    mark: "i32"

def execute(u: Inputs, y: Outputs, x: State) -> None:
    y.runs += 1
    x.mark = y.runs
    if u.ask == 1:
        y.transition_request = TransitionRequest.GO
    if u.ask == 2:
        y.transition_request = TransitionRequest.HALT
    if u.ill == 1:
        y.health = Health.degraded
    if u.ill == 2:
        y.health = Health.failed
    y.quotient = 100 // u.divisor
"""

COUNTER = """
class Inputs:
    value: "i32"
    dt: "f64 s"
    time_ns: "i64 ns"
    tick: "u64"

class Outputs:
    seen: "i32"
    runs: "i32"
    dt: "f64 s"
    time_ns: "i64 ns"
    number: "u64"

def execute(u: Inputs, y: Outputs) -> None:
    y.seen = u.value
    y.runs += 1
    y.dt = u.dt
    y.time_ns = u.time_ns
    y.number = u.tick
"""


class Kind:
    """How the machines of the running test run."""

    machine: type[Machine]


@pytest.fixture(params=[Machine, InReference], ids=["compiled", "CPython"], autouse=True)
def kind(request: pytest.FixtureRequest) -> None:
    """Runs every test of a module that imports this with each of them."""
    Kind.machine = request.param


def machine(tmp_path: Path, config: Mapping[str, Any], **algorithms: str) -> Machine:
    defaults = {"tick_hz": 1000, "initial_state": "A"}
    return Kind.machine.build(write_machine(tmp_path, "table", {**defaults, **config}, algorithms))


def puppet_machine(tmp_path: Path, **more: Any) -> Machine:
    """A and B run both puppets at every tick, C runs only `two`, at every third."""
    both = {"one": 1000, "two": 1000}
    config = {
        "instances": {
            "one": {"algorithm": "puppet", "inputs": {"divisor": 1}},
            "two": {"algorithm": "puppet", "inputs": {"divisor": 1}},
        },
        "states": {"A": {"schedule": both}, "B": {"schedule": both}, "C": {"schedule": {"two": {"every": 3}}}},
        "transitions": [
            {"from": "A", "to": "B", "request": "GO", "priority": 1},
            {"from": ["A", "B"], "to": "C", "request": "HALT", "priority": 5},
            {"from": "C", "to": "A", "request": "GO", "priority": 1},
        ],
        **more,
    }
    return machine(tmp_path, config, puppet=PUPPET)


def run_table(m: Machine, columns: list[str], table: list[tuple[Mapping[str, Any], list[Any]]]) -> None:
    """Each row: what the host sets before the tick, and what the columns hold after it."""
    for tick, (inputs, expected) in enumerate(table):
        for path, value in inputs.items():
            m.set(path, value)
        m.step()
        assert [m.get(c) for c in columns] == expected, f"tick {tick}: {columns}"
