# SPDX-License-Identifier: Apache-2.0
"""`event`: what an execute reports when it completes, compiled and in CPython, without any effect on the machine."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine
from fcsl_test_programs import build
from fcsl_test_twins import Twins

from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import toolchain

LAW = """
class Law:
    inputs = {"x": "f64", "k": "i32", "d": "i32"}
    outputs = {"y": "f64"}
    state = {"n": "u32", "big": "u64", "s": "f32", "i": "i64"}

    def execute(self):
        self.n = self.n + 1
        self.i = self.i - 1
        event("run", self.n, self.x, self.k > 2, self.s)
        if self.k > 3:
            self.health = "degraded"
            event("gate passed", self.k // self.d, self.health, severity="warning")
        self.y = self.x
        self.big -= 1
        self.s = f32(0.1)
        event("wide", self.big, self.i, self.k, 7, severity="error")
        for j in range(2):
            event("loop", j, 0.5, severity="debug")
        self.y = 1.0 / f64(100 // self.d)
"""


def told(twins: Twins) -> list[tuple[str, int, str, tuple[Any, ...]]]:
    """Those of the last tick, with the number of the line in the class."""
    lost, rows = twins.native.told()
    assert lost == 0
    return rows


def test_values_of_every_type(tmp_path: Path) -> None:
    twins = build(tmp_path, "law", LAW, {})
    twins.set("one.inputs.x", 2.5)
    twins.set("one.inputs.k", -4)
    twins.set("one.inputs.d", 7)
    twins.step()
    assert [row[1:] for row in told(twins)] == [
        (10, "run", (1, 2.5, False, 0.0)),
        (17, "wide", (2**64 - 1, -1, -4, 7)),
        (19, "loop", (0, 0.5)),
        (19, "loop", (1, 0.5)),
    ]
    twins.set("one.inputs.k", 15)
    twins.set("one.inputs.x", float("nan"))
    twins.step()
    rows = told(twins)
    assert rows[0] == ("one", 10, "run", (2, "nan", True, pytest.approx(0.1, abs=1e-8)))
    assert rows[1] == ("one", 13, "gate passed", (2, "degraded"))
    sites = [(s.text, s.severity, s.value_count) for s in twins.native.event_sites()]
    assert sites == [(b"run", 1, 4), (b"gate passed", 2, 2), (b"wide", 3, 4), (b"loop", 0, 2)]


@pytest.mark.parametrize("d", [0, 1000])
def test_a_fault_takes_them_back(tmp_path: Path, d: int) -> None:
    """0 faults in a value of an event, 1000 in the last line."""
    twins = build(tmp_path, "law", LAW.replace("100 // self.d", "100 // (self.d % 1000)"), {})
    twins.set("one.inputs.k", 9)
    twins.set("one.inputs.d", d)
    twins.step(2)
    assert twins.get("one.counters.faults") == 2 and told(twins) == []
    twins.set("one.inputs.d", 1)
    twins.step()
    assert [row[2] for row in told(twins)] == ["run", "gate passed", "wide", "loop", "loop"]


def several(folder: Path) -> Twins:
    """Two instances of one algorithm, which share its code, around one that faults."""
    law = """
class Law:
    inputs = {"d": "i32"}
    outputs = {"y": "i32"}
    def execute(self):
        event("began", self.d)
        event("on one line"); event("twice on it", 100 // self.d)
        self.y = 100 // self.d
class Quiet:
    outputs = {"y": "i32"}
    def execute(self):
        self.y = 1
"""
    config: dict[str, Any] = {"tick_hz": 100, "initial_state": "A"}
    config["instances"] = {n: {"algorithm": "Law"} for n in ("a", "b", "c")} | {"q": {"algorithm": "Quiet"}}
    config["states"] = {"A": {"schedule": {"a": 100, "b": 100, "q": 100, "c": 50}}}
    return Twins(write_machine(folder, "several", config, {"law": law}))


def test_a_fault_of_one_instance_leaves_the_events_of_others(tmp_path: Path) -> None:
    twins = several(tmp_path)
    for name, d in (("a", 2), ("b", 0), ("c", 5)):
        twins.set(f"{name}.inputs.d", d)
    twins.step()
    of_a = [("a", 6, "began", (2,)), ("a", 7, "on one line", ()), ("a", 7, "twice on it", (50,))]
    of_c = [("c", 6, "began", (5,)), ("c", 7, "on one line", ()), ("c", 7, "twice on it", (20,))]
    assert told(twins) == [*of_a, *of_c]
    twins.step()
    assert told(twins) == of_a
    twins.set("b.inputs.d", 1)
    for machine in (twins.native, twins.python):
        machine.byte(machine.instances["a"].inject_fault_offset)[0] = 1  # instead of its execute
        machine.byte(machine.instances["b"].inject_fault_offset)[0] = 2  # after it: degraded
    twins.step()
    assert [row[0] for row in told(twins)] == ["b", "b", "b", "c", "c", "c"]
    assert twins.get("b.outputs.health") == "degraded"


def test_a_tick_has_a_bound(tmp_path: Path) -> None:
    """Those without room are counted, unless their run faults."""
    text = """
class Law:
    inputs = {"n": "i32", "d": "i32"}
    outputs = {"y": "i32"}
    def execute(self):
        for i in range(100):
            if i < i64(self.n):
                event("many", i)
        self.y = 1 // self.d
"""
    twins = build(tmp_path, "law", text, {})
    for n, d, kept, lost in ((64, 1, 64, 0), (65, 1, 64, 1), (100, 1, 64, 36), (100, 0, 0, 0), (3, 1, 3, 0)):
        twins.set("one.inputs.n", n)
        twins.set("one.inputs.d", d)
        twins.step()
        found_lost, rows = twins.native.told()
        assert (len(rows), found_lost) == (kept, lost)
        assert [values for *_, values in rows] == [(i,) for i in range(kept)]


def test_they_change_no_bit(tmp_path: Path) -> None:
    """The same machine without its events: the same struct in every tick, and the same layout; only its source differs."""
    without = re.sub(r"event\(.*\)", "pass", LAW)
    assert without != LAW
    twins = [build(tmp_path / name, "law", text, {}) for name, text in (("with", LAW), ("without", without))]
    d, other = twins[0].native.d, twins[1].native.d
    assert (d.layout_hash, d.size) == (other.layout_hash, other.size) and d.source_hash != other.source_hash
    for tick in range(40):
        for one in twins:
            one.set("one.inputs.x", tick * 0.3)
            one.set("one.inputs.k", tick)
            one.set("one.inputs.d", tick % 4)
            one.step()
        # The number of a fault's place is that of a row of the machine's own table.
        places = [one.native.raw("one.counters.fault_place") for one in twins]
        kept = [list(p) for p in places]
        places[0][0] = places[1][0] = 0
        assert twins[0].native.save() == twins[1].native.save()
        for place, value in zip(places, kept, strict=True):
            place[0] = value[0]


def test_a_host_without_a_list(tmp_path: Path) -> None:
    """Events are lost, and nothing else is."""
    twins = several(tmp_path)
    machine = Machine.build(next(tmp_path.glob("*.json")))
    machine._host.events = None
    for m in (twins, machine):
        for name, d in (("a", 2), ("b", 0), ("c", 5)):
            m.set(f"{name}.inputs.d", d)
    twins.step(3)
    machine.step(3)
    assert machine.save() == twins.native.save()


def test_a_machine_without_events_has_no_code_for_them(tmp_path: Path) -> None:
    text = "class Law:\n    outputs = {'y': 'f64'}\n    def execute(self):\n        self.y = 1.0\n"
    build(tmp_path, "law", text, {})
    compiled = compile_machine(next(tmp_path.rglob("*.json")), toolchain())
    assert "event" not in compiled.source


def test_event_may_be_a_name(tmp_path: Path) -> None:
    """A file that does not call it may have a constant, a local or a port of this name."""
    text = """
event_limit = 3.0
class Law:
    inputs = {"event": "f64"}
    outputs = {"y": "f64"}
    def execute(self):
        event = self.event * 2.0
        self.y = event + event_limit
"""
    twins = build(tmp_path, "law", text, {})
    twins.set("one.inputs.event", 1.0)
    twins.step()
    assert twins.get("one.outputs.y") == 5.0
