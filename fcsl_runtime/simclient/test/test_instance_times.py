# SPDX-License-Identifier: Apache-2.0
"""Times of instances (fcsl build --times): counts are exact, and the instance that takes longest is found. No test
compares a time with a number, since computers are busy."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from native import flying

from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin, ProcessTwin, PyTwin, TwinError
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.instance_times import InstanceTime, of_stats
from simclient.vars.cli import main
from simclient.vars.client import VarClient
from simclient.vars.top import lines

SOURCE = """class Light:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = self.x + 1.0


class Heavy:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        sum = self.x
        for i in range(5000):
            sum = sum * 0.5 + f64(i)
        self.y = sum


class Faulty:
    outputs = {"y": "i64"}

    def execute(self):
        self.y = 1 // (self.y - self.y)
"""
TICKS = 40
#: How often each instance of the machine runs in these ticks, and its steps.
RUNS = {"light": 40, "heavy": 40, "slow": 10, "faulty": 40, "idle": 0, "machine": 40}
INSTANCES = tuple(name for name in RUNS if name != "machine")


def write(folder: Path) -> Path:
    config = {
        "tick_hz": 1000,
        "initial_state": "RUN",
        "algorithms": {name: {"source": "law.py"} for name in ("Light", "Heavy", "Faulty")},
        "instances": {
            "light": {"algorithm": "Light", "max_wcet_us": 900000},
            "heavy": {"algorithm": "Heavy"},
            "slow": {"algorithm": "Light"},
            "faulty": {"algorithm": "Faulty"},
            "idle": {"algorithm": "Light"},
        },
        "connections": [{"from": "light.y", "to": "heavy.x"}],
        "states": {
            "RUN": {"schedule": {"light": 1000, "heavy": 1000, "slow": 250, "faulty": 1000}},
            "REST": {"schedule": {"idle": 1000}},
        },
        "transitions": [
            {"from": "RUN", "to": "REST", "request": "STOP"},
            {"from": "REST", "to": "RUN", "request": "GO"},
        ],
    }
    folder.mkdir(exist_ok=True)
    (folder / "law.py").write_text(SOURCE)
    (folder / "craft.json").write_text(json.dumps(config))
    return folder / "craft.json"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return write(tmp_path / "craft")


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSL_TIMES", "1")


def check(times: dict[str, InstanceTime]) -> None:
    assert {name: row.runs for name, row in times.items()} == RUNS
    spent = {name: times[name].total_ns for name in INSTANCES}
    assert max(spent, key=lambda name: spent[name]) == "heavy"
    assert times["heavy"].share > sum(times[name].share for name in INSTANCES if name != "heavy")
    assert sum(spent.values()) <= times["machine"].total_ns and times["machine"].share == 1.0
    for name, row in times.items():
        assert row.p50_ns <= row.p99_ns <= row.max_ns <= row.total_ns, name
        assert row.mean_ns == (row.total_ns // row.runs if row.runs else 0), name
    assert times["idle"] == InstanceTime(*[0] * 6, 0.0)


@pytest.mark.parametrize("backend", ["c", "nim"])
def test_a_twin_finds_the_instance_that_takes_longest(config: Path, measured: None, backend: str) -> None:
    with AlgTwin.from_config(config, backend=backend) as twin:
        assert all(row.runs == 0 for row in twin.instance_times().values())
        twin.tick(TICKS)
        check(twin.instance_times())
        assert twin.get_value("faulty.counters.faults") == TICKS


def test_values_are_those_of_the_machine_without(config: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    hashes, digests = [], []
    for times in ("", "1"):
        monkeypatch.setenv("FCSL_TIMES", times)
        bag = tmp_path / f"bag{times}"
        with AlgTwin.from_config(config) as twin:
            twin.record(bag)
            twin.tick(TICKS)
            twin.stop_recording()
            machine = twin.machine
            hashes.append((machine.source_hash, machine.layout_hash, machine.build_hash))
            totals = {name: row.total_ns for name, row in twin.instance_times().items()} if times else {}
        digests.append(digest(bag))
    assert hashes[0][:2] == hashes[1][:2] and hashes[0][2] != hashes[1][2] and digests[0] == digests[1]
    recorded = list(Bag(tmp_path / "bag1").messages({"/craft/record/times"}))
    assert len(recorded) == TICKS and "/craft/record/times" not in Bag(tmp_path / "bag").topics
    # Encapsulation, header, tick; then a number for each instance and one for the step.
    rows = [struct.unpack_from("<6I", message, len(message) - 24) for _, _, message in recorded]
    assert [sum(column) for column in zip(*rows, strict=True)] == list(totals.values())
    ran = [[bool(ns) for ns in column] for column in zip(*rows, strict=True)]
    assert [sum(column) for column in ran][1:3] == [RUNS["heavy"], RUNS["slow"]]
    assert [tick for tick, row in enumerate(rows) if row[2]] == list(range(0, TICKS, 4))


def test_a_machine_that_is_not_measured_says_so(config: Path, measured: None, monkeypatch: pytest.MonkeyPatch) -> None:
    with PyTwin.from_config(config) as twin, pytest.raises(TwinError, match="fcsl build --times"):
        twin.instance_times()
    monkeypatch.delenv("FCSL_TIMES")
    with AlgTwin.from_config(config) as twin, pytest.raises(TwinError, match="`craft` does not measure"):
        twin.instance_times()


def test_flight_program(
    config: Path, measured: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    library, socket, summary = str(build_machine(config).library), tmp_path / "fc", tmp_path / "summary.json"
    monkeypatch.setenv("FCSL_SOCKET", str(socket))
    with flying("--socket", socket, "--paused", "--summary", summary, library=library) as fc:
        fc.client(socket).close()
        with VarClient(socket) as client:
            client.tick(TICKS)
            assert client.get("times.heavy.runs") == {"times.heavy.runs": TICKS}
            served = {f"times.{name}.{what}" for name in RUNS for what in ("runs", "total_ns", "last_ns", "max_ns")}
            assert set(client.list("times.")) == served
            assert client.eval("times.heavy.total_ns <= times.machine.total_ns") is True
            check(of_stats(client.stats()["times"]))
        assert main(["top"]) == 0
        printed = capsys.readouterr().out
        assert main(["top", "--json"]) == 0
        assert {name: row["runs"] for name, row in json.loads(capsys.readouterr().out).items()} == RUNS
        status, *logs = fc.stop()
    shown = printed.splitlines()
    assert shown[0] == f"tick {TICKS}  RUN  paused" and shown[1].startswith("tick time  p50 ")
    assert "0 deadlines missed, 0 ticks skipped" in shown
    rows = [line.split() for line in shown[shown.index("") + 2 :]]
    assert rows[0][0] == "heavy" and [row[0] for row in rows[-2:]] == ["(rest)", "step"]
    assert {row[0]: row[1] for row in rows if row[0] in INSTANCES} == {name: str(RUNS[name]) for name in INSTANCES}
    check(of_stats(json.loads(summary.read_text())["times"]))
    said = [line.removeprefix("fcsl-fc: ") for line in "".join(logs).splitlines()]
    at = next(n for n, line in enumerate(said) if line.startswith("step: mean "))
    assert status == 0 and said[at + 1].startswith("heavy: 40 runs, mean ") and "idle: did not run" in said[at:]


def test_command_refuses_a_machine_that_is_not_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with flying("--socket", tmp_path / "fc", "--paused") as fc:
        fc.client(tmp_path / "fc").close()
        assert main(["top", "--socket", str(tmp_path / "fc")]) == 1
        assert "`fixture` does not measure its instances: build it with `fcsl build --times`" in capsys.readouterr().err


def test_process_twin(config: Path, measured: None) -> None:
    with ProcessTwin.from_config(config) as twin:
        twin.tick(TICKS)
        check(twin.instance_times())


def test_shares_are_of_the_last_second() -> None:
    """Of a live table: the time since it was drawn before, not since the run began."""

    def times(*total_ns: int) -> dict[str, InstanceTime]:
        names = ("early", "late", "machine")
        return {name: InstanceTime(9, ns, ns // 9, 1, 2, 3, 0.0) for name, ns in zip(names, total_ns, strict=True)}

    stats = {"tick": 9, "paused": False, "state": "RUN"}
    table = lines(stats, times(9000, 1000, 12000), times(8900, 100, 10000), 1000.0)
    assert [(row.split()[0], row.split()[-2:]) for row in table[-4:-1]] == [
        ("late", ["45.0", "%"]),
        ("early", ["5.0", "%"]),
        ("(rest)", ["50.0", "%"]),
    ]
