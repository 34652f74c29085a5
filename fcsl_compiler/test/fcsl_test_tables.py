# SPDX-License-Identifier: Apache-2.0
"""Machines that are stepped against hand-written tables: compiled ones, and CPython's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import InReference

# Repeats inputs of the host as outputs: requests, health, faults. Counts its runs.
PUPPET = """
class Puppet:
    inputs = {
        "ask": "i32",  # 1: GO, 2: HALT
        "ill": "i32",  # 1: degraded, 2: failed
        "divisor": "i32",
    }
    outputs = {"runs": "i32", "quotient": "i32", "transition_request": "TransitionRequest"}
    state = {"mark": "i32"}

    def execute(self):
        self.runs += 1
        self.mark = self.runs
        if self.ask == 1:
            self.transition_request = "GO"
        if self.ask == 2:
            self.transition_request = "HALT"
        if self.ill == 1:
            self.health = "degraded"
        if self.ill == 2:
            self.health = "failed"
        self.quotient = 100 // self.divisor
"""

COUNTER = """
class Counter:
    inputs = {"value": "i32", "period": "f64 s", "now_ns": "i64 ns", "tick": "u64"}
    outputs = {"seen": "i32", "runs": "i32", "dt": "f64 s", "time_ns": "i64 ns", "number": "u64"}

    def execute(self):
        self.seen = self.value
        self.runs += 1
        self.dt = self.period
        self.time_ns = self.now_ns
        self.number = self.tick
"""


class Kind:
    """The kind of machine in the current test."""

    machine: type[Machine]


@pytest.fixture(params=[Machine, InReference], ids=["compiled", "CPython"], autouse=True)
def kind(request: pytest.FixtureRequest) -> None:
    """Runs every test of an importing module with each kind."""
    Kind.machine = request.param


def machine(tmp_path: Path, config: Mapping[str, Any], **algorithms: str) -> Machine:
    defaults = {"tick_hz": 1000, "initial_state": "A"}
    return Kind.machine.build(write_machine(tmp_path, "table", {**defaults, **config}, algorithms))


def puppet_machine(tmp_path: Path, **more: Any) -> Machine:
    """A and B run both puppets in every tick, C runs only `two`, in every third."""
    both = {"one": 1000, "two": 1000}
    config = {
        "instances": {
            "one": {"algorithm": "Puppet", "inputs": {"divisor": 1}},
            "two": {"algorithm": "Puppet", "inputs": {"divisor": 1}},
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
    """Each row: values that the host sets before the tick, and expected columns after it."""
    for tick, (inputs, expected) in enumerate(table):
        for path, value in inputs.items():
            m.set(path, value)
        m.step()
        assert [m.get(c) for c in columns] == expected, f"tick {tick}: {columns}"
