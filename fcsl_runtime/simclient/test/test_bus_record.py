# SPDX-License-Identifier: Apache-2.0
"""fcsl bus record: what reproduces a run, from the numbers of the host's writes; a machine that reads hardware."""

from __future__ import annotations

import json
import random
import re
import select
import signal
import struct
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
from native import PROGRAM
from test_bus_tools import LONG_S, library  # noqa: F401  a fixture

from simclient import AlgTwin, VarClient
from simclient.bag import Bag
from simclient.bus.bag_ticks import read_bag_ticks
from simclient.bus.free_port import free_endpoint
from simclient.bus.machine import BusMachine
from simclient.bus.messages import RECORD_TOPICS
from simclient.bus.reproduction import Reproduction
from simclient.bus.ticks import Tick
from simclient.bus.writes import Checkpoint, Write, Written, read_checkpoint, read_writes
from simclient.errors import BagError
from simclient.replay import replay
from simclient.run import open_run

MESSAGES = Path(__file__).resolve().parents[3] / "fcsl_msgs/msg"
MACHINE = BusMachine("m", "m", "", 0, 100, (), "")
ALGORITHM = """
from fcsl_builtins import f64, hw_read_adc


class Probe:
    inputs = {"level": "f64"}
    outputs = {"sum": "f64"}
    parameters = {"gain": "f64 1 mutable"}

    def execute(self):
        self.sum += self.gain * f64(hw_read_adc(3)) + self.level


class Law:
    inputs = {"sum": "f64"}
    outputs = {"out": "f64"}

    def execute(self):
        self.out = self.out * 0.5 + self.sum
"""
PROBE = {
    "tick_hz": 200,
    "initial_state": "A",
    "algorithms": {"Probe": {"source": "probe.py"}, "Law": {"source": "probe.py"}},
    "instances": {"probe": {"algorithm": "Probe", "parameters": {"gain": 0.25}}, "law": {"algorithm": "Law"}},
    "connections": [{"from": "probe.sum", "to": "law.sum"}],
    "states": {"A": {"schedule": {"probe": 200, "law": 200}}, "B": {"schedule": {"law": 200}}},
    "channels": [
        {"name": "level", "id": 1, "field": "probe.inputs.level", "direction": "sensor"},
        {"name": "out", "id": 2, "field": "law.outputs.out", "direction": "actuator"},
    ],
}


def test_a_machine_that_reads_hardware(tmp_path: Path) -> None:
    """What its instance left is in the bag, so it is not run again; with samples and writes of a client between."""
    (tmp_path / "probe.py").write_text(ALGORITHM)
    (tmp_path / "probe.json").write_text(json.dumps(PROBE))
    built = subprocess.run(["fcslc", "build", tmp_path / "probe.json", "-o", tmp_path], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    probe, endpoint, socket = tmp_path / "libprobe.so", free_endpoint(), tmp_path / "socket"
    line = [PROGRAM, probe, "--observers", endpoint, "--namespace", "north", "--socket", socket, "--paused"]
    pipe = subprocess.PIPE
    with (
        subprocess.Popen([str(word) for word in line], stdout=pipe, stderr=pipe, text=True) as fc,
        subprocess.Popen(
            ["fcsl", "bus", "record", "-c", endpoint, "-o", tmp_path / "bag"],
            stdout=pipe,
            stderr=pipe,
            text=True,
        ) as recorder,
    ):
        try:
            assert recorder.stdout and recorder.stdout.readline().startswith("recording north/probe to ")
            with VarClient(socket) as client:
                client.hardware("adc", 3, 1500)
                while recorder_waits(recorder):
                    client.pause()  # once more: what is published then has the first checkpoint
                client.attach("level")
                for counts in (700, 2500, 3):
                    client.hardware("adc", 3, counts)
                    client.sample("level", counts * 0.125, age_ticks=2, stamp_ns=5)
                    client.set({"probe.parameters.gain": counts / 3.0})
                    tick_followed(client, 20)
                client.set_state("B")
                tick_followed(client, 10)
                last = client.get_value("machine.tick") - 1
            fc.send_signal(signal.SIGTERM)
            out, err = recorder.communicate(timeout=LONG_S)
        finally:
            fc.kill()
            recorder.kill()
    assert recorder.returncode == 0, err
    (begin, end) = map(int, re.findall(r"north/probe: reproduces ticks (\d+) to (\d+)", out)[0])
    assert begin == 0 and end == last == 69
    found = replay(tmp_path / "bag", library=str(probe))
    assert found.identical and found.values == found.ticks == end + 1 - begin, str(found)
    assert any("outputs of `probe` come from the record" in note for note in found.notes)
    whole = tmp_path / "bag"
    with pytest.raises(BagError, match="`fcsl bus record` made it"):
        Bag(whole).machine()


def tick_followed(client: VarClient, ticks: int) -> None:
    """Makes ticks, and waits until observers have them: the history holds 64, and a busy machine is slow to follow."""
    client.tick(ticks)
    wanted = client.get_value("machine.tick")
    give_up_s = time.monotonic() + LONG_S
    while client.stats()["observers"]["ticks"] < wanted:
        assert time.monotonic() < give_up_s
        time.sleep(0.005)


def recorder_waits(recorder: subprocess.Popen[str]) -> bool:
    """Whether its checkpoint has yet to come."""
    assert recorder.stdout
    return not select.select([recorder.stdout], [], [], 0.05)[0]


# ---- numbers ----------------------------------------------------------------------------------------------------------


class Question:
    def __init__(self, answers: list[bytes]):
        self._answers = answers
        self.is_over = False

    def answer(self) -> bytes | None:
        self.is_over = bool(self._answers)
        return self._answers.pop(0) if self._answers else None


class Host:
    """Answers for checkpoints with what a test puts into `answers`, and a clock."""

    def __init__(self) -> None:
        self.answers: list[bytes] = []
        self.now_s = 0.0
        self.queries = 0
        self.told = Reproduction(MACHINE, self, lambda: self.now_s)  # type: ignore[arg-type]

    def query(self, key: str) -> Question:
        assert key == "m/@checkpoint"
        self.queries += 1
        return Question(self.answers)

    def takes(self, *events: Any) -> list[Any]:
        return [found for event in events for found in self.told.take(event)]


def message(tick: int) -> bytes:
    return struct.pack("<4siIIB3xQ", b"\0\1\0\0", 0, 0, 1, 0, tick) + b"rest"


def checkpoint(tick: int, number: int) -> bytes:
    return struct.pack("<Q", number) + message(tick)


def tick(number: int, *writes: int, following: int) -> list[Any]:
    """What comes of a tick."""
    return [*(Write(w, message(number)) for w in writes), Written(number + 1, following), Tick(number, [])]


def test_what_is_in_a_bag_lies_in_order() -> None:
    host = Host()
    assert host.takes(Write(4, message(7)), *tick(7, 5, following=6)) == []  # writes before may be missing
    assert host.queries == 1
    host.answers += [checkpoint(7, 5), checkpoint(9, 7)]  # the first one is of a time before
    assert host.takes(*tick(8, 6, following=7), None, None) == []
    found = host.takes(*tick(9, 7, 8, following=9), *tick(10, 9, following=10), *tick(11, following=10))
    assert [type(one) for one in found[:4]] == [Tick, Tick, Checkpoint, Write]
    assert [one.number for one in found if isinstance(one, Write)] == [7, 8, 9]
    assert [one.tick for one in found if isinstance(one, Tick)] == [7, 8, 9, 10, 11]
    assert str(host.told) == "reproduces ticks 9 to 11" and host.told.reproduces


@pytest.mark.parametrize(
    ("events", "said"),
    [
        (tick(10, 9, following=10), "host writes 7 to 8 were lost on the way, behind tick 9"),
        ([Written(11, 12)], "host writes 7 to 11 were lost on the way, behind tick 9"),
        ([Written(11, 3)], "host writes from 7 on were lost on the way, behind tick 9"),
    ],
)
def test_a_gap_in_the_numbers(events: list[Any], said: str) -> None:
    host = Host()
    host.answers += [checkpoint(9, 7)]
    host.takes(*tick(7, 5, following=6), *tick(8, 6, following=7), None, *tick(9, following=7))
    assert str(host.told) == "reproduces ticks 9 to 9"
    found = host.takes(*events, *tick(11, 20, following=21))
    assert not any(isinstance(one, Write) for one in found) and any(isinstance(one, Tick) for one in found)
    assert host.told.lacks == said and str(host.told) == f"does not reproduce the run: {said}"


def test_a_gap_before_the_checkpoint_is_none() -> None:
    host = Host()
    host.takes(*tick(7, 5, following=6), *tick(8, 7, following=8))
    host.answers += [checkpoint(8, 6), checkpoint(9, 8)]
    host.takes(None, None, *tick(9, 8, following=9))
    found = host.takes(*tick(10, following=9))
    assert str(host.told) == "reproduces ticks 9 to 10", found


def test_no_checkpoint() -> None:
    host = Host()
    assert host.takes(*tick(7, following=6)) == []
    host.now_s = 6.0
    assert [type(one) for one in host.takes(*tick(8, following=6))] == [Tick, Tick]
    assert host.told.lacks == "no checkpoint came"
    old = Host()
    assert old.takes(Tick(1, [])) == []
    assert list(old.told.end()) == [Tick(1, [])]
    assert old.told.lacks == "no host writes came: the program serves none"


def test_messages_that_are_none() -> None:
    assert read_writes("@writes", bytes(35)) is None and read_writes("@written", bytes(15)) is None
    assert read_writes("@writes", bytes(36)) and read_writes("tick", bytes(16)) is None
    assert read_checkpoint(bytes(35)) is None and read_checkpoint(bytes(36)) is not None


def test_whatever_comes() -> None:
    randomly = random.Random(5)
    for _ in range(200):
        host = Host()
        host.answers = [randomly.randbytes(randomly.choice((0, 8, 36, 60))) for _ in range(3)]
        for _ in range(100):
            number = randomly.choice((0, 1, 2, 3, 2**63, 2**64 - 1))
            host.now_s += 0.1
            host.takes(randomly.choice((None, Write(number, message(1)), Written(number, number), Tick(number, []))))
        assert host.told.lacks or host.told.reproduces or not host.told._waiting or host.now_s < 15.0
        str(host.told)


# ---- what is played ----------------------------------------------------------------------------------------------------


def test_a_tape_of_a_bag_that_a_host_recorded(library: Path, tmp_path: Path) -> None:  # noqa: F811
    """Samples of their ticks and all actuators, as bytes of the bus, up to a restored checkpoint."""
    with AlgTwin.from_library(library) as twin:
        twin.record(tmp_path / "bag")
        twin.attach("packet")
        saved = b""
        for tick in range(6):
            if tick == 2:
                twin.sample("packet", [3, 0x41, 0x42, 0x143, 7, 0, 0, 0, 0])
            if tick == 3:
                twin.sample("offset", [[1, -2], [3, 4]])
                twin.set("rig.inputs.ready", True)
            twin.tick()
            saved = twin.save() if tick < 2 else saved
        twin.restore(saved)
        twin.tick(3)
    run = open_run(library, None)
    try:
        with pytest.raises(BagError, match="needs the machine: --config FILE or --library FILE"):
            read_bag_ticks(Bag(tmp_path / "bag"), None)
        tape = read_bag_ticks(Bag(tmp_path / "bag"), run)
        tape.check()
        ticks = list(tape.ticks())
    finally:
        run.close()
    assert [tick.tick for tick in ticks] == [0, 1, 2, 3, 4, 5]
    assert "restored before tick 6" in tape.stop
    assert {tick.tick: tick.sensors for tick in ticks if tick.sensors} == {
        2: {"packet": b"ABC"},
        3: {"offset": struct.pack("<4i", 1, -2, 3, 4)},
    }
    assert ticks[4].actuators == {
        "reply": b"\xab\0", "count": (5).to_bytes(8, "little"), "angle": struct.pack("<d", 2.5)
    }  # fmt: skip
    assert dict(tape.left_out) == {"SET": 1, "RESTORE": 1}


def test_definitions_are_those_of_the_interfaces() -> None:
    for name, (kind, definition) in RECORD_TOPICS.items():
        if kind.startswith("fcsl_msgs/"):
            text = (MESSAGES / f"{kind.rpartition('/')[2]}.msg").read_text()
            wanted = [line.partition("#")[0].strip() for line in text.splitlines()]
            assert definition.partition("=====")[0].split("\n")[:-1] == [line for line in wanted if line], name
