# SPDX-License-Identifier: Apache-2.0
"""fcsl bus on a flight program: what it prints, puts, records and refuses."""

from __future__ import annotations

import contextlib
import json
import queue
import random
import re
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh
from native import PROGRAM

from simclient.bag import Bag, rows_of
from simclient.bag.bus_topics import topic_of
from simclient.bag.info import describe
from simclient.bus.cli import _read_descriptors
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.bus.machine import BusChannel, BusMachine, read_machine
from simclient.bus.messages import definition_of, message_of, type_names
from simclient.bus.session import Session
from simclient.bus.ticks import TickReader
from simclient.errors import BusError

LONG_S = 60
ALGORITHM = """class Rig:
    inputs = {"packet": "u32[9]", "attitude": "f32[4]", "ready": "bool", "offset": "i32[2][2]"}
    outputs = {"reply": "u32[5]", "count": "u64 1", "angle": "f64 rad"}

    def execute(self):
        self.count += 1
        self.angle = f64(self.count) * 0.5
        self.reply[0] = 2
        self.reply[1] = 0xAB
"""
ROWS = (
    ("packet", "inputs.packet", "sensor", "blob"),
    ("imu.attitude", "inputs.attitude", "sensor", "quaternion"),
    ("ready", "inputs.ready", "sensor", ""),
    ("offset", "inputs.offset", "sensor", ""),
    ("reply", "outputs.reply", "actuator", "blob"),
    ("count", "outputs.count", "actuator", ""),
    ("angle", "outputs.angle", "actuator", ""),
)
MACHINE = {
    "tick_hz": 200,
    "initial_state": "A",
    "algorithms": {"Rig": {"source": "rig.py"}},
    "instances": {"rig": {"algorithm": "Rig"}},
    "states": {"A": {"schedule": {"rig": 200}}},
    "channels": [
        {"name": name, "id": i + 1, "field": f"rig.{field}", "direction": way, **({"as": kind} if kind else {})}
        for i, (name, field, way, kind) in enumerate(ROWS)
    ],
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "rig.py").write_text(ALGORITHM)
    (folder / "rig.json").write_text(json.dumps(MACHINE))
    done = subprocess.run(["fcslc", "build", folder / "rig.json", "-o", folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "librig.so"


@contextlib.contextmanager
def flying(library: Path, endpoint: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    line = [PROGRAM, str(library), "--observers", endpoint, *options]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as fc:
        try:
            assert fc.stdout
            while "observers on" not in (said := fc.stdout.readline()):
                assert said, "the flight program ended"
            yield fc
        finally:
            fc.kill()


@pytest.fixture(scope="module")
def endpoint(library: Path) -> Iterator[str]:
    """Of a flight in real time, that lasts as long as the tests."""
    where = free_endpoint()
    with flying(library, where, "--namespace", "north/hill"):
        yield where


def tool(*arguments: str | Path, status: int = 0) -> tuple[str, str]:
    line = ["fcsl", "bus", *(str(a) for a in arguments)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout, done.stderr


def follow_to_the_end(library: Path, *arguments: str | Path) -> tuple[str, int]:
    """What a tool prints about a flight that ends a second after the tool's first line, and the ticks of the flight."""
    where = free_endpoint()
    line = ["fcsl", "bus", *(str(a) for a in arguments), "-c", where]
    with flying(library, where) as fc, subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as follower:
        assert follower.stdout
        first = follower.stdout.readline()
        time.sleep(1.0)
        fc.send_signal(signal.SIGINT)
        said, _ = fc.communicate(timeout=LONG_S)
        rest, _ = follower.communicate(timeout=LONG_S)
    assert (fc.returncode, follower.returncode) == (0, 0) and ", 0 dropped" in said
    return first + rest, int(re.findall(r"(\d+) ticks,", said)[0])


@pytest.fixture(scope="module")
def rig(endpoint: str) -> BusMachine:
    with Session(endpoint) as session:
        (machine,), _ = session.machines()
    return machine


# ---- the command ------------------------------------------------------------------------------------------------------


def test_list(endpoint: str) -> None:
    head, *rows = tool("list", "-c", endpoint)[0].splitlines()
    assert head.startswith("north/hill/rig: 200 Hz, sources ")
    words = [row.split() for row in rows]
    assert [row[:3] for row in words] == [
        ["packet", "sensor", "blob[8]"],
        ["imu.attitude", "sensor", "f32[4]"],
        ["ready", "sensor", "bool"],
        ["offset", "sensor", "i32[2][2]"],
        ["reply", "actuator", "blob[4]"],
        ["count", "actuator", "u64"],
        ["angle", "actuator", "f64"],
    ]
    assert words[-1][3] == "rad" and words[-1][-1] == "Hz"
    assert all(20 < float(row[-2]) < 2000 for row in words)  # of 200 Hz, where the processors are busy
    (told,) = json.loads(tool("list", "-c", endpoint, "--json", "-s", "0.2")[0])
    assert told["prefix"] == "north/hill/rig" and told["descriptor"]["tick_hz"] == 200
    assert told["rates_hz"]["angle"] > 0


def test_a_machine_that_cannot_be_read_hides_no_other(endpoint: str) -> None:
    config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
    config.insert_json5("connect/endpoints", f'["{zenoh_locator(endpoint)}"]')
    key = "south/rig/@descriptor"
    with zenoh.open(config) as bus:
        served = bus.declare_queryable(key, lambda query: query.reply(key, b"{}"))
        out, err = tool("list", "-c", endpoint, "-s", "0.1")
        served.undeclare()
    assert out.startswith("north/hill/rig: 200 Hz") and "south" not in out
    assert err == "fcsl bus: left out: the descriptor of south/rig is not one of docs/reference/transports.md\n"


def test_echo(endpoint: str) -> None:
    lines = tool("echo", "-c", endpoint, "-n", "14")[0].splitlines()
    assert len(lines) == 14 and len({line.split()[0] for line in lines}) in (2, 3)
    assert {line.split()[1] for line in lines} == {name for name, *_ in ROWS}
    shown = {line.split()[1]: line.split("  ", 2)[2] for line in lines}
    assert shown["reply"] == "ab00" and shown["ready"] == "false" and shown["offset"] == "[[0, 0], [0, 0]]"
    told = [json.loads(line) for line in tool("echo", "-c", endpoint, "--json", "-n", "5", "angle")[0].splitlines()]
    ticks = [one["tick"] for one in told]
    assert len(ticks) == 5 and ticks == sorted(set(ticks))  # a busy machine drops some
    assert all(one["value"] == (one["tick"] + 1) * 0.5 and one["machine"] == "north/hill/rig" for one in told)


def test_hz(endpoint: str) -> None:
    (line,) = tool("hz", "-c", endpoint, "--seconds", "1")[0].splitlines()
    assert line.startswith("1 s  north/hill/rig/packet ")
    assert 20 < int(line.split("rig/angle ")[1].split()[0]) < 2000


def test_a_reader_that_goes(endpoint: str) -> None:
    line = f"fcsl bus echo -c {endpoint} | head -n 3"
    done = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert len(done.stdout.splitlines()) == 3 and done.stderr == ""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_recording_is_complete(endpoint: str, number: signal.Signals, tmp_path: Path) -> None:
    lost, folders = True, iter(range(20))
    while lost:  # a busy computer costs an observer ticks, which it counts: this is about a recording without
        path = tmp_path / f"bag{next(folders)}"
        line = ["fcsl", "bus", "record", "-c", endpoint, "-o", str(path)]
        with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as recorder:
            assert recorder.stdout and "recording north/hill/rig to" in recorder.stdout.readline()
            with pytest.raises(subprocess.TimeoutExpired):
                recorder.wait(1.0)
            recorder.send_signal(number)
            out, err = recorder.communicate(timeout=LONG_S)
        lost = re.fullmatch(r"fcsl bus: \d+ ticks and \d+ values were lost, 0 messages refused\n", err) is not None
        assert recorder.returncode == 0 and (lost or err == "")
    bag = Bag(path)
    text = describe(bag, "")
    assert bag.truncated == "" and "damage     none" in text
    assert bag.topics["/north/hill/rig/imu/attitude"].type == "rig_bus/msg/ImuAttitude"
    assert sum(topic.count for topic in bag.topics.values()) == int(re.findall(r": (\d+) messages", out)[0])
    rows = rows_of(bag, "/north/hill/rig/angle")
    ticks = rows["tick"].tolist()
    assert len(ticks) > 50 and ticks == list(range(ticks[0], ticks[0] + len(ticks)))
    assert rows["value"].tolist() == [(tick + 1) * 0.5 for tick in ticks]
    stamps = rows["header.stamp.sec"].astype("i8") * 10**9 + rows["header.stamp.nanosec"]
    assert stamps.tolist() == [tick * 5_000_000 for tick in ticks]
    offset = rows_of(bag, "/north/hill/rig/offset")
    assert offset["value"].shape == (len(offset), 4)
    whole = set(range(ticks[0] + 1, ticks[-1]))  # it may begin and end between two messages of one tick
    assert whole <= set(offset["tick"].tolist()) <= whole | {ticks[0] - 1, ticks[0], ticks[-1], ticks[-1] + 1}
    assert "exists already" in tool("record", "-c", endpoint, "-o", path, status=2)[1]


def test_the_end_of_the_flight_ends_a_recording(library: Path, tmp_path: Path) -> None:
    out, ticks = follow_to_the_end(library, "record", "-o", tmp_path / "bag")
    bag = Bag(tmp_path / "bag")
    assert int(out.split(" messages")[0].split()[-1]) == sum(topic.count for topic in bag.topics.values())
    assert rows_of(bag, "/rig/count")["tick"][-1] == ticks - 1
    assert re.search(f"rig: reproduces ticks [0-9]+ to {ticks - 1}$", out)


def test_the_end_of_the_flight_ends_hz(library: Path) -> None:
    assert follow_to_the_end(library, "hz")[0].startswith("1 s  rig/packet ")


def test_put(endpoint: str, rig: BusMachine, tmp_path: Path) -> None:
    """Who subscribes on the bus gets it; with a file, also where no descriptor is served."""
    got: queue.Queue[bytes] = queue.Queue()
    saved = tmp_path / "rig.json"
    saved.write_text(tool("list", "-c", endpoint, "-s", "0.1", "--json")[0])
    with Session(endpoint) as session:
        session._session.declare_subscriber("north/hill/rig/offset", lambda s: got.put(bytes(s.payload)))
        for options in ([], ["--descriptor", saved]):
            tool("put", "-c", endpoint, *options, "offset", "[[1, -2], [3, 4]]")
            while (data := got.get(timeout=LONG_S)) == bytes(16):
                pass  # the flight's own
            assert data == struct.pack("<4i", 1, -2, 3, 4)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["offset", "[1, 2]"], "`offset` is i32[2][2]: write [[0, 0], [0, 0]]"),
        (["offset", "[[1, 2], [3, 4.5]]"], "write a whole number, not 4.5"),
        (["offset", "[[1, 2], [3, 3000000000]]"], "3000000000 is outside its range, -2147483648 to 2147483647"),
        (["count", "-1"], "outside its range, 0 to 18446744073709551615"),
        (["ready", "1"], "write true or false, not 1"),
        (["angle", "true"], "write a number, not True"),
        (["imu.attitude", "[1e99, 0, 0, 0]"], "1e+99 is outside its range"),
        (["packet", "xyz"], "write its bytes in hex"),
        (["packet", "00" * 9], "a blob of at most 8 bytes, not 9"),
        (["angel", "1"], "no machine here has a channel `angel`; did you mean `angle`?"),
        (["rig", "1", "2"], "unrecognized arguments"),
    ],
)
def test_what_put_refuses(endpoint: str, words: list[str], said: str) -> None:
    _, err = tool("put", "-c", endpoint, "--", *words, status=2)
    assert said in err


def test_nobody_there(tmp_path: Path) -> None:
    where = free_endpoint()
    assert (
        f"no bus listens on {where}: start fcsl-fc or fcsl-sim with --observers"
        in tool("list", "-c", where, status=2)[1]
    )
    assert zenoh_locator("tcp:[::1]:7447") == zenoh_locator("tcp/[::1]:7447") == "tcp/[::1]:7447"
    for wrong in ("udp:127.0.0.1:7447", "tcp:127.0.0.1", "tcp/127.0.0.1:7447#iface=eth0", "tcp:tcp:127.0.0.1:1"):
        with pytest.raises(BusError, match="write tcp:HOST:PORT"):
            zenoh_locator(wrong)
    assert "write tcp:HOST:PORT" in tool("echo", "-c", "127.0.0.1:7447", status=2)[1]
    (tmp_path / "wrong.json").write_text("[1]")
    with pytest.raises(BusError, match="not what `fcsl bus list --json` prints"):
        _read_descriptors(tmp_path / "wrong.json")


def test_without_zenoh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(BusError, match="pip install eclipse-zenoh"):
        Session("tcp:127.0.0.1:7447")


# ---- descriptors and values -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [
        {"version": 2},
        {"channels": 1},
        {"channels": [{}]},
        {"tick_hz": "100"},
        {"tick_hz": 0},
        {"machine": "a/*"},
        {"channels": [{"name": "a", "direction": "sensor", "type": "f64", "shape": [1] * 99, "as": "field"}]},
        {"table_hash": -1},
        {"channels": [{"name": "a", "direction": "sensor", "type": "f64", "shape": [1 << 40], "as": "field"}]},
        {"channels": [{"name": "a", "direction": "sensor", "type": "f16", "shape": [], "as": "field"}]},
        {"channels": [{"name": "a", "direction": "sensor", "type": "u32", "shape": [], "as": "blob"}]},
    ],
)
def test_a_descriptor_that_is_none(rig: BusMachine, change: dict[str, Any]) -> None:
    with pytest.raises(BusError):
        read_machine("m", json.dumps(json.loads(rig.text) | change))
    with pytest.raises(BusError):
        read_machine("m", "[" * 100_000)


def test_values_there_and_back(rig: BusMachine) -> None:
    values = {"packet": "00ff", "imu.attitude": [1.0, 0.5, -0.25, 0.0], "ready": True, "offset": [[1, 2], [3, -4]]}
    for channel in rig.channels[:4]:
        data = channel.encode(values[channel.name])
        assert channel.decode(data) == values[channel.name]
        assert channel.is_blob or channel.decode(data + b"\0") is None
    assert rig.channels[0].decode(bytes(9)) is None and rig.channels[2].decode(b"\2") is None


class Bus:
    """Messages of a machine with a sensor `a` and an actuator `b`, one byte each."""

    def __init__(self) -> None:
        channels = tuple(
            BusChannel(i, name, way, "bool", (), False, "", "")
            for i, (name, way) in enumerate((("a", "sensor"), ("b", "actuator")))
        )
        self.reader = TickReader(BusMachine("m", "m", "", 7, 100, channels, ""))

    def commit(self, tick: int, way: int = 0, bits: int = 1, table: int = 7) -> dict[str, bytes] | None:
        found = self.reader.take("tick", struct.pack("<QQIBBHB", tick, 0, table, way, 0, 2, bits))
        return None if found is None else {channel.name: data for channel, data in found.values}


def test_values_belong_to_the_commit_behind_them() -> None:
    bus = Bus()
    assert bus.commit(4) is None  # what came before it may be a part
    bus.reader.take("a", b"\1")
    bus.reader.take("b", b"\1")
    assert bus.commit(5) == {"a": b"\1"}
    assert bus.commit(6, bits=0) == {} and not bus.reader.lost
    assert bus.commit(7) == {} and bus.reader.lost.values == 1  # its value was dropped
    bus.reader.take("a", b"\1")
    assert bus.commit(9) is None and bus.reader.lost.ticks == 2  # of tick 8 or 9, nobody knows
    for value in (b"\0", b"\1"):
        bus.reader.take("a", value)
    assert bus.commit(10) == {}  # two values for one tick
    bus.reader.take("a", b"\7")
    assert bus.commit(11) == {} and bus.reader.lost.values == 3
    bus.reader.take("a", b"\1")
    assert bus.commit(2) is None  # another run
    assert bus.reader.lost.refused == 0
    lost = bus.reader.lost
    bus.reader.take("a", b"\0")
    bus.reader.jump()  # a checkpoint of tick 40 was restored
    bus.reader.take("a", b"\1")
    assert bus.commit(40) == {"a": b"\1"} and bus.commit(41, bits=0) == {} and bus.reader.lost == lost


def test_the_first_tick_of_all_needs_none_before_it() -> None:
    bus = Bus()
    bus.reader.take("a", b"\1")
    assert bus.commit(0) == {"a": b"\1"} and not bus.reader.lost
    late = Bus()
    assert late.commit(0) == {} and late.reader.lost.values == 1


def test_messages_that_are_none() -> None:
    bus = Bus()
    reader = bus.reader
    randomly = random.Random(3)
    assert bus.commit(1, table=8) is None and bus.commit(1, way=3) is None
    assert reader.take("c", b"") is None and reader.take("tick", b"") is None
    assert reader.lost.refused == 4
    for _ in range(20_000):
        name = randomly.choice(("a", "b", "tick", "@control"))
        reader.take(name, randomly.randbytes(randomly.choice((0, 1, 25))))
    assert all(len(waiting) <= 2 for state in reader._directions.values() for waiting in state.waiting.values())


def test_names_of_messages() -> None:
    channels = tuple(
        BusChannel(i, n, "sensor", "f32", (3,), False, "m", "two\nlines") for i, n in enumerate(("a.b", "a_b", "3d"))
    )
    machine = BusMachine("n-s/M1", "M1", "", 0, 1, channels, "")
    assert list(type_names(machine).values()) == ["m1_bus/msg/AB", "m1_bus/msg/ABId1", "m1_bus/msg/Channel3d"]
    assert topic_of(machine.prefix, channels[0].name) == "/n_s/M1/a/b"
    assert definition_of(channels[0]).startswith(
        "# two lines\nstd_msgs/Header header\nuint64 tick\nfloat32[3] value  # m\n"
    )
    assert len(message_of(channels[0], 1, 2, bytes(12))) == 4 + 24 + 12
