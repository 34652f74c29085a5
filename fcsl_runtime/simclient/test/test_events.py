# SPDX-License-Identifier: Apache-2.0
"""Events of algorithms: in twins, in bags, and again in a replay."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot
from native import flying
from rosbags.highlevel import AnyReader
from rrd import read_rrd, values

from fcsl_compiler.api.build import build_machine
from simclient import AlgTwin, Event, ProcessTwin, PyTwin, Twin, TwinError
from simclient.bag import Bag, formats
from simclient.replay.reproduce import Replay
from simclient.run import open_run
from simclient.view.picture import choose, draw
from simclient.view.recorded import RecordedRun
from simclient.view.rrd import to_rerun

LAW = """
class Law:
    inputs = {"gate": "i32", "speed": "f32", "d": "i32"}
    outputs = {"y": "f64"}
    state = {"last": "i32", "n": "u64"}

    def execute(self):
        self.n += 1
        if self.gate != self.last:
            self.last = self.gate
            event("gate passed", self.gate, self.speed, self.gate > 2, severity="warning")
        event("ran", self.n, self.health, severity="debug")
        self.y = f64(100 // self.d)
"""
IO = """
class Io:
    outputs = {"volts": "f64"}
    state = {"n": "i64"}

    def execute(self):
        self.n = self.n + 1
        counts = hw_read_adc(3)
        self.volts = f64(counts) * 0.5
        if counts > 1000:
            event("over voltage", self.volts, counts, severity="error")
        if self.n % 3 == 0:
            event("read", self.n)
"""


def config(folder: Path, hz: int = 100) -> Path:
    (folder / "law.py").write_text(LAW)
    (folder / "io.py").write_text(IO)
    machine: dict[str, Any] = {"tick_hz": hz, "initial_state": "A"}
    machine["algorithms"] = {"Law": {"source": "law.py"}, "Io": {"source": "io.py"}}
    law: dict[str, Any] = {"algorithm": "Law", "inputs": {"d": 5}}
    machine["instances"] = {"a": law, "io": {"algorithm": "Io"}, "b": law}
    machine["states"] = {"A": {"schedule": {"a": hz, "b": hz // 2, "io": hz}}}
    path = folder / "machine.json"
    path.write_text(json.dumps(machine))
    return path


def fly(twin: Twin, ticks: int = 130) -> list[Event]:
    """Gates at ticks 3 and 50, faults of `b` in between, and a voltage that rises."""
    for tick in range(ticks):
        twin.set_many({"a.inputs.gate": (tick >= 3) + (tick >= 50), "a.inputs.speed": 0.1})
        twin.set_many({"b.inputs.gate": tick, "b.inputs.d": 0 if 10 < tick < 20 else 4})
        twin.hardware.adc[3] = 1200 if 60 <= tick < 62 else 7
        twin.tick()
    return twin.events


def test_a_flight_program_tells_a_twin(tmp_path: Path) -> None:
    path = config(tmp_path)
    with AlgTwin.from_config(path) as twin, ProcessTwin.from_config(path) as process:
        for one in (twin, process):
            one.set_many(
                {"a.inputs.gate": 3, "a.inputs.speed": 0.1, "b.inputs.gate": 2, "b.inputs.speed": float("inf")}
            )
            one.tick(12)
        events = twin.events
        assert process.events == events and len(events) == 22
    assert [e.values[1] for e in events if e.text == "gate passed"] == [pytest.approx(0.1), float("inf")]


def texts(events: list[Event], instance: str) -> list[tuple[int, str, tuple[Any, ...]]]:
    return [(e.tick, e.text, e.values) for e in events if e.instance == instance and e.severity != "debug"]


def test_twins_tell_the_same(tmp_path: Path) -> None:
    path = config(tmp_path)
    with AlgTwin.from_config(path) as twin, PyTwin.from_config(path) as python:
        events = fly(twin)
        assert fly(python) == events
    single = pytest.approx(0.1, abs=1e-8)
    assert texts(events, "a") == [(3, "gate passed", (1, single, False)), (50, "gate passed", (2, single, False))]
    gates = [tick for tick, _, _ in texts(events, "b")]
    assert gates == [2, 4, 6, 8, 10, 20, 22, 24, 26, 28, 100, 102, 104, 106, 108, 110, 112, 114, 116, 118]
    assert texts(events, "io")[:3] == [(2, "read", (3,)), (5, "read", (6,)), (8, "read", (9,))]
    over = [e for e in events if e.text == "over voltage"]
    assert [(e.tick, e.values, e.severity, e.time_ns) for e in over] == [
        (60, (600.0, 1200), "error", 600_000_000),
        (61, (600.0, 1200), "error", 610_000_000),
    ]
    first = next(e for e in events if e.text == "gate passed" and e.instance == "a")
    assert (first.file, first.line, str(first)) == ("law.py", 11, "a: gate passed 1 0.1 false")
    ran = next(e for e in events if e.text == "ran")
    assert (ran.values, ran.severity, str(ran)) == ((1, "nominal"), "debug", "a: ran 1 nominal")


def test_ten_of_a_place_in_a_second(tmp_path: Path) -> None:
    """Seconds are the machine's. The next one says how many were suppressed. Places and instances count apart."""
    with AlgTwin.from_config(config(tmp_path)) as twin:
        events = [e for e in fly(twin, 205) if e.instance == "a" and e.text == "ran"]
    assert [e.tick for e in events] == [*range(10), *range(100, 110), *range(200, 205)]
    assert [e.tick for e in events if e.suppressed] == [100, 200] and events[10].suppressed == 90
    assert str(events[10]) == "a: ran 101 nominal (90 before it suppressed)"


def test_the_last_1024_are_kept(tmp_path: Path) -> None:
    with AlgTwin.from_config(config(tmp_path)) as twin:
        twin.tick(10_000)
        events = twin.events
    assert len(events) == 1024 and events[-1].tick == 9929  # io reports in every third tick
    assert [e.tick for e in events] == sorted(e.tick for e in events)


def test_a_restored_twin_tells_anew(tmp_path: Path) -> None:
    with AlgTwin.from_config(config(tmp_path)) as twin:
        twin.tick(50)
        saved, before = twin.save(), len(twin.events)
        twin.restore(saved)
        twin.tick(2)
        assert [(e.tick, e.instance, e.suppressed) for e in twin.events[before:] if e.text == "ran"] == [
            (50, "a", 0),
            (50, "b", 0),
            (51, "a", 0),
        ]


def recorded(bag: Path) -> list[Any]:
    with AnyReader([bag]) as reader:
        connections = [c for c in reader.connections if c.topic == "/veh/machine/events"]
        assert [c.msgtype for c in connections] == ["fcsl_msgs/msg/Event"]
        return [(t, reader.deserialize(data, c.msgtype)) for c, t, data in reader.messages(connections)]


def test_a_bag_has_them_and_a_replay_tells_them_again(tmp_path: Path) -> None:
    """Recorded from the middle of a second on, and without the hardware that the flight had."""
    path = config(tmp_path)
    with AlgTwin.from_config(path) as twin:
        twin.tick(55)
        before = len(twin.events)
        twin.record(tmp_path / "bag", "veh")
        events = fly(twin)[before:]
    messages = recorded(tmp_path / "bag")
    severities = {10: "debug", 20: "info", 30: "warning", 40: "error"}
    assert [
        (t, m.tick, severities[m.severity], m.instance, m.text, m.file, m.line, m.suppressed) for t, m in messages
    ] == [(e.time_ns, e.tick, e.severity, e.instance, e.text, e.file, e.line, e.suppressed) for e in events]
    assert [" ".join([m.text, *m.values]) for _, m in messages] == [e.message.partition(" (")[0] for e in events]
    bag, run = Bag(tmp_path / "bag"), open_run(build_machine(path).library, None)
    verdict = Replay(bag, bag.machine(), run).run()
    assert verdict.identical, str(verdict)
    assert run.events() == events
    run.close()


def test_recorded_events_are_checked(tmp_path: Path) -> None:
    run = open_run(build_machine(config(tmp_path)).library, None)
    io = 1
    one = (1).to_bytes(8, "little") + bytes(32)
    with pytest.raises(TwinError, match="39 bytes are no events of one tick"):
        run.substitute_events(io, one[:-1])
    with pytest.raises(TwinError, match="2600 bytes are no events of one tick"):
        run.substitute_events(io, one * 65)
    with pytest.raises(TwinError, match="instance 'io' has no event number 2"):
        run.substitute_events(io, (2).to_bytes(8, "little") + bytes(32))
    for instance in (0, 3):  # without hardware, and none
        with pytest.raises(TwinError, match=f"instance number {instance} has no recorded events"):
            run.substitute_events(instance, one)
    run.close()


def test_pictures_and_rerun_show_them(tmp_path: Path) -> None:
    with AlgTwin.from_config(config(tmp_path)) as twin:
        twin.record(tmp_path / "bag", "veh")
        events = fly(twin)
    run = RecordedRun(formats.opened(tmp_path / "bag"))
    assert list(map(str, run.events)) == list(map(str, events))
    figure = draw(run, choose(run, ["io.outputs.volts"]), "")
    marks = sorted(tuple(line.get_xdata()) for line in figure.axes[0].lines if line.get_marker() == "^")
    shown = ("info", "warning", "error")
    assert marks == sorted(tuple(e.time_ns * 1e-9 for e in events if e.severity == severity) for severity in shown)
    pyplot.close(figure)
    to_rerun(tmp_path / "bag", tmp_path / "run.rrd")
    rows = read_rrd(tmp_path / "run.rrd")
    assert values(rows, "/veh/machine/events", "TextLog:text") == [(e.time_ns / 1e9, str(e)) for e in events]


def test_a_flight_program_prints_and_serves_them(tmp_path: Path) -> None:
    library, summary = build_machine(config(tmp_path)).library, tmp_path / "summary.json"
    options = ("--socket", tmp_path / "fc.sock", "--paused", "--summary", summary)
    with flying(*options, library=str(library)) as fc:
        client = fc.client(tmp_path / "fc.sock")
        client.ok("set", values={"a.inputs.gate": 3})
        client.ok("tick", count=30)
        served = client.ok("stats")["events"]
        client.close()
        code, out, err = fc.stop()
    counts = {"told": 31, "suppressed": 25, "lost": 0}  # ten of 30 and of 15 `ran`, one gate, ten `read`
    assert code == 0 and {name: served[name] for name in counts} == counts
    gate = {"tick": 0, "severity": "warning", "instance": "a", "message": "gate passed 3 0 true"}
    gate |= {"text": "gate passed", "values": [3, 0, True], "suppressed": 0, "file": "law.py", "line": 11}
    assert served["last"][0] == gate
    assert len(served["last"]) == 31 and json.loads(summary.read_text())["events"] == served
    assert "fcsl-fc: warning: 'a': gate passed 3 0 true (tick 0, law.py:11)\n" in err
    assert "fcsl-fc: 'io': read 3 (tick 2)\n" in out and "'a': ran" not in out + err
    assert "fcsl-fc: events: 31 told, 25 suppressed, 0 without room\n" in out
