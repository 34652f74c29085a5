# SPDX-License-Identifier: Apache-2.0
"""Optimisations of a tick: omitted clock readings and copies for faults; and machines whose tick is split into several
C functions. Every table holds for compiled machines and for CPython's."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_twins import InReference

from fcsl_compiler.check.fault_points import written_before_fault
from fcsl_compiler.driver.passes import compile_machine

COUNT = """
class Count:
    inputs = {"value": "i64"}
    outputs = {"sum": "i64", "runs": "i64"}

    def execute(self):
        self.sum = self.value + 1
        self.runs += 1
"""

#: Faults in iteration n. Writes of earlier iterations must be restored; `late` is written at the end.
LOOP = """
class Loop:
    inputs = {"n": "i64", "flag": "bool"}
    outputs = {"rounds": "i64[3]", "late": "i64", "hinted": "bool"}
    state = {"quotient": "i64", "untouched": "f64[9]"}

    def execute(self):
        for i in range(3):
            self.quotient = 100 // (self.n - i)
            self.rounds[i] = self.n
        self.late = self.quotient
        self.hinted = self.flag
        self.untouched[0] = 1.0
"""


@pytest.fixture(params=[Machine, InReference], ids=["compiled", "CPython"])
def kind(request: pytest.FixtureRequest) -> type[Machine]:
    found: type[Machine] = request.param
    return found


def config(tmp_path: Path, instances: dict[str, Any], schedule: dict[str, Any], **more: Any) -> Path:
    whole = {
        "tick_hz": 1000,
        "initial_state": "A",
        "instances": instances,
        "states": {"A": {"schedule": schedule}},
        **more,
    }
    algorithms = {name: text for name, text in (("count", COUNT), ("loop", LOOP)) if name.title() in str(instances)}
    return write_machine(tmp_path, "cost", whole, algorithms)


def test_neighbours_share_readings_of_the_clock(tmp_path: Path, kind: type[Machine]) -> None:
    """a, b, d, e are timed, c is not: {a, b} and {d, e} are spans. n due instances of a span take n + 1 readings."""
    timed = {"algorithm": "Count", "max_wcet_us": 10}
    every_2, every_3 = {"every": 2}, {"every": 3}
    schedule = {"a": 1000, "b": every_2, "c": 1000, "d": every_2, "e": every_3}
    instances = {n: {"algorithm": "Count"} if n == "c" else timed for n in "abcde"}
    m = kind.build(config(tmp_path, instances, schedule))
    readings: list[int] = []
    durations = iter([0, 5_000, 10_001, 0, 3_000, 3_000, 0, 20_000, 0, 1, 1, 1_000_000, 10_001])

    def now() -> int:
        readings.append((readings[-1] if readings else 0) + next(durations, 0))
        return readings[-1]

    m.use_clock(now)
    seen = []
    for _ in range(4):
        before = len(readings)
        m.step()
        seen.append((len(readings) - before, *(m.get(f"{n}.counters.overruns") for n in "abde")))
    assert seen == [
        (6, 0, 1, 0, 0),  # a 5 µs, b 10.001; c; d 3, e 3
        (2, 1, 1, 0, 0),  # a 20
        (5, 1, 1, 1, 0),  # a, b 1 ns; c took the time before the first reading of d; d 10.001
        (4, 1, 1, 1, 0),  # a; e
    ]


def test_what_a_loop_wrote_before_it_faulted_goes(tmp_path: Path, kind: type[Machine]) -> None:
    m = kind.build(config(tmp_path, {"one": {"algorithm": "Loop"}}, {"one": 1000}))
    columns = [f"one.{c}" for c in ("outputs.rounds", "outputs.late", "outputs.health", "state.quotient")]
    for n, expected in (
        (5, [[5, 5, 5], 33, "nominal", 33]),
        (2, [[5, 5, 5], 33, "failed", 33]),  # two iterations had been written
        (1, [[5, 5, 5], 33, "failed", 33]),
        (0, [[5, 5, 5], 33, "failed", 33]),
        (-1, [[-1, -1, -1], -34, "nominal", -34]),
    ):
        m.set("one.inputs.n", n)
        m.step()
        got = [m.get(c) for c in columns]
        assert [list(got[0]), *got[1:]] == expected, n
    assert m.get("one.counters.faults") == 3


def test_only_what_precedes_a_fault_is_kept(tmp_path: Path) -> None:
    path = config(tmp_path, {"one": {"algorithm": "Loop"}}, {"one": 1000})
    execute = compile_machine(path, "").checked.instances[0].execute
    assert written_before_fault(execute) == {("outputs", "rounds"), ("state", "quotient")}


@pytest.mark.parametrize("limit", [0, 10])
def test_a_tick_of_many_instances_keeps_their_order(tmp_path: Path, kind: type[Machine], limit: int) -> None:
    """120 instances in sequence, every third due in every other tick: split into parts that pass on the clock
    reading."""
    names = [f"n{k}" for k in range(120)]
    instances = {n: {"algorithm": "Count", **({"max_wcet_us": limit} if limit else {})} for n in names}
    connections = [{"from": f"{a}.sum", "to": f"{b}.value"} for a, b in zip(names, names[1:], strict=False)]
    schedule = {n: {"every": 2} if k % 3 == 2 else 1000 for k, n in enumerate(names)}
    m = kind.build(config(tmp_path, instances, schedule, connections=connections))
    readings: list[int] = []

    def now() -> int:
        readings.append(20_000 if len(readings) >= 60 else 0)
        return readings[-1]

    m.use_clock(now)
    m.step()
    assert m.get("n119.outputs.sum") == 120 and len(readings) == (121 if limit else 0)
    m.step()  # the first waiting link keeps its old sum, which the later ones use
    assert m.get("n119.outputs.sum") == 120 and len(readings) == (121 + 81 if limit else 0)
    assert [m.get(f"n{k}.outputs.runs") for k in (0, 1, 2, 49, 50, 119)] == [2, 2, 1, 2, 1, 1]
    overrun = [n for n in names if m.get(f"{n}.counters.overruns")]
    assert overrun == (["n59"] if limit else [])


def test_a_span_of_rates_that_lie_in_different_parts(tmp_path: Path, kind: type[Machine]) -> None:
    """The clock is read in the first part for an instance in the second."""
    names = [f"n{k}" for k in range(60)]
    instances = {n: {"algorithm": "Count", "max_wcet_us": 10} for n in names}
    schedule = {n: {"every": 2 if k < 50 else 3} for k, n in enumerate(names)}
    m = kind.build(config(tmp_path, instances, schedule))
    readings: list[int] = []

    def now() -> int:
        readings.append(0)
        return 0

    m.use_clock(now)
    seen = []
    for _ in range(4):
        before = len(readings)
        m.step()
        seen.append(len(readings) - before)
    assert seen == [61, 0, 51, 11]
