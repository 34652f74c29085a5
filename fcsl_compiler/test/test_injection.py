# SPDX-License-Identifier: Apache-2.0
"""Injection by a host, tick by tick: overruns with their clock, faults and healths."""

from pathlib import Path

import pytest
from fcsl_test_abi import Machine
from fcsl_test_tables import PUPPET, kind, machine

from fcsl_compiler.driver.library import emit

__all__ = ["kind"]  # runs all tests here on both kinds of machine


def timed(tmp_path: Path) -> Machine:
    config = {
        "instances": {"one": {"algorithm": "Puppet", "inputs": {"divisor": 1}, "max_wcet_us": 50}},
        "states": {"A": {"schedule": {"one": 1000}}, "B": {"schedule": {}}},
        "transitions": [{"from": "A", "to": "B", "request": "GO"}],
        "requests": ["HALT"],
    }
    return machine(tmp_path, config, puppet=PUPPET)


def test_injected_overrun_demotes_once(tmp_path: Path) -> None:
    m = timed(tmp_path)
    inject = m.byte(m.instances["one"].inject_overrun_offset)
    columns = ["one.outputs.health", "one.counters.overruns"]
    m.step()
    assert [m.get(c) for c in columns] == ["nominal", 0]
    inject[0] = 1
    m.step()
    assert [m.get(c) for c in columns] == ["degraded", 1] and inject[0] == 0
    m.step()
    assert [m.get(c) for c in columns] == ["nominal", 1]
    inject[0] = 1
    m.set("one.inputs.ill", 2)
    m.step()  # health is the worst of all
    assert [m.get(c) for c in columns] == ["failed", 2]


def test_injected_fault_is_a_fault(tmp_path: Path) -> None:
    """Outputs and state stay, the request is withdrawn, health is failed, faults are counted; the next execute runs
    normally."""
    m = timed(tmp_path)
    inject = m.byte(m.instances["one"].inject_fault_offset)
    m.set("one.inputs.ask", 1)
    m.step()
    assert (m.get("one.outputs.runs"), m.get("one.outputs.transition_request")) == (1, "GO")
    m.force_state("A")
    inject[0] = 1
    before = m.get("one.state.mark"), m.get("one.outputs.runs")
    m.step()
    assert (m.get("one.state.mark"), m.get("one.outputs.runs")) == before
    assert (m.get("one.outputs.transition_request"), m.get("one.outputs.health")) == ("", "failed")
    assert (m.get("one.counters.faults"), m.get("machine.next_state"), inject[0]) == (1, "A", 0)
    m.step()
    assert (m.get("one.outputs.runs"), m.get("one.outputs.health"), m.get("one.counters.faults")) == (2, "nominal", 1)


@pytest.mark.parametrize(("inject", "health"), [(2, "degraded"), (3, "failed")])
def test_injected_health_is_the_least_of_one_execute(tmp_path: Path, inject: int, health: str) -> None:
    """The execute counts, requests included. Its own health may be worse."""
    m = timed(tmp_path)
    for ill, worst in ((0, health), (2, "failed")):
        m.byte(m.instances["one"].inject_fault_offset)[0] = inject
        m.set("one.inputs.ask", 1)
        m.set("one.inputs.ill", ill)
        m.step()
        assert (m.get("one.outputs.transition_request"), m.get("one.outputs.health")) == ("GO", worst)
        m.force_state("A")
    assert (m.get("one.outputs.runs"), m.get("one.counters.faults")) == (2, 0)
    m.set("one.inputs.ill", 0)
    m.step()
    assert m.get("one.outputs.health") == "nominal"


def test_injected_fault_waits_for_an_execute(tmp_path: Path) -> None:
    m = timed(tmp_path)
    m.byte(m.instances["one"].inject_fault_offset)[0] = 1
    m.force_state("B")
    m.step(5)
    assert m.get("one.counters.faults") == 0
    m.force_state("A")
    m.step()
    assert (m.get("one.counters.faults"), m.get("one.outputs.health")) == (1, "failed")


def test_clock_decides_overruns(tmp_path: Path) -> None:
    m = timed(tmp_path)
    times = iter([0, 50_000, 100_000, 150_001, 200_000, 200_000])
    m.use_clock(lambda: next(times))
    seen = []
    for _ in range(3):
        m.step()
        seen.append((m.get("one.outputs.health"), m.get("one.counters.overruns")))
    assert seen == [("nominal", 0), ("degraded", 1), ("nominal", 1)]
    assert next(times, None) is None  # two readings a tick


READS_HEALTH = """\
class Reader:
    outputs = {"seen": "bool"}

    def execute(self):
        self.seen = self.health == "nominal"
"""


@pytest.mark.parametrize("inject", [2, 3])
def test_an_algorithm_does_not_see_the_health_that_is_injected(tmp_path: Path, inject: int) -> None:
    """It makes the health worse after `execute`."""
    config = {
        "instances": {"one": {"algorithm": "Reader"}},
        "states": {"A": {"schedule": {"one": 1000}}},
        "transitions": [],
    }
    m = machine(tmp_path, config, reader=READS_HEALTH)
    m.byte(m.instances["one"].inject_fault_offset)[0] = inject
    m.step()
    assert (m.get("one.outputs.seen"), m.get("one.outputs.health")) == (True, ["degraded", "failed"][inject - 2])


#: Its `execute` may take long enough for a watchdog.
BUSY = """\
class Busy:
    outputs = {"sum": "f64"}

    def execute(self):
        for i in range(2000):
            self.sum += 0.5
"""


def test_a_brief_instance_leaves_no_number(tmp_path: Path) -> None:
    for name, text, noted in (("brief", BUSY.replace("2000", "200"), False), ("busy", BUSY, True)):
        config = {
            "instances": {"one": {"algorithm": name.capitalize()}},
            "states": {"A": {"schedule": {"one": 1000}}},
            "transitions": [],
        }
        folder = tmp_path / name
        folder.mkdir()
        machine(folder, config, **{name: text.replace("Busy", name.capitalize())})
        (path,) = folder.glob("*.json")
        emit([path], folder)
        assert ("current_ = 0" in path.with_suffix(".c").read_text()) == noted


def test_watchdog_sees_no_instance_between_ticks(tmp_path: Path) -> None:
    config = {
        "instances": {"one": {"algorithm": "Busy", "max_wcet_us": 50}},
        "states": {"A": {"schedule": {"one": 1000}}},
        "transitions": [],
    }
    m = machine(tmp_path, config, busy=BUSY)
    during: list[int] = []

    def now() -> int:
        during.append(int.from_bytes(m.save()[m.d.current_offset :][:4], "little", signed=True))
        return 0

    m.use_clock(now)
    m.step()
    assert during == [-1, 0]  # before its inputs are copied; after it ran
    assert int.from_bytes(m.save()[m.d.current_offset :][:4], "little", signed=True) == -1
