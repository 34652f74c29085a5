# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages as named values: a simulator made of rosbags and Zenoh's own package flies with fcsl-fc, and sends it what is
none; fcsl bus shows and records the values of them."""

from __future__ import annotations

import json
import math
import queue
import struct
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from native import PROGRAM
from rosbags.typesys import Stores, get_typestore

from fcsl_compiler.model.types import SCALARS, Array, Type
from fcsl_compiler.ros.channels import standard_mapping
from fcsl_compiler.ros.standard_messages import full_name
from simclient.bag import Bag, rows_of
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.bus.machine import BusMachine, read_machine
from simclient.bus.payload import Payload
from simclient.bus.session import Session
from simclient.errors import BusError

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
LONG_S = 60
#: The message of std_msgs, the type in a machine, and a value of each kind.
KINDS: tuple[tuple[str, str, Any], ...] = (
    ("Bool", "bool", True),
    ("Int32", "i32", -(2**31)),
    ("Int64", "i64", -(2**63)),
    ("UInt32", "u32", 2**32 - 1),
    ("UInt64", "u64", 2**64 - 1),
    ("Float32", "f32", -0.5),
    ("Float64", "f64", 0.1),
    ("UInt8MultiArray", "bool[3]", [1, 0, 1]),
    ("Int32MultiArray", "i32[2][2]", [1, -2, 3, -4]),
    ("Int64MultiArray", "i64[2]", [2**62, -1]),
    ("UInt32MultiArray", "u32[2]", [2**32 - 1, 0]),
    ("UInt64MultiArray", "u64[1]", [2**64 - 1]),
    ("Float32MultiArray", "f32[3]", [1.5, -2.5, 0.0]),
    ("Float64MultiArray", "f64[2][3]", [1.0, 2.0, 3.0, 4.0, 5.0, 0.1]),
)
NAMES = [f"v{i}" for i in range(len(KINDS))]


def machine_files(folder: Path) -> Path:
    ports = {name: kind for name, (_, kind, _) in zip(NAMES, KINDS, strict=True)} | {
        "packet": "u32[5]",
        "rate": "f64[3] rad/s",
        "level": "i32",
    }
    inputs = ", ".join(f'"{name}": "{kind}"' for name, kind in ports.items())
    outputs = ", ".join(f'"{name}_out": "{kind}"' for name, kind in ports.items())
    body = "\n".join(f"        self.{name}_out = self.{name}" for name in ports)
    (folder / "echo.py").write_text(
        f"class Echo:\n    inputs = {{{inputs}}}\n    outputs = {{{outputs}}}\n\n    def execute(self):\n{body}\n"
    )
    imu = {"type": "sensor_msgs/Imu", "field": "angular_velocity", "frame": "imu_link", "axes": "frd"}
    channels = []
    for way, record, suffix in (("sensor", "inputs", ""), ("actuator", "outputs", "_out")):
        for name in ports:
            bits = 16 if way == "sensor" else 8
            special: dict[str, dict[str, Any]] = {
                "packet": {"as": "blob"},
                "rate": {"ros": {**imu, "topic": f"imu{suffix}"}},
                "level": {"ros": {"type": f"std_msgs/Int{bits}", "field": "data", "topic": f"level{suffix}"}},
            }
            row = {
                "name": f"{name}{suffix}",
                "id": len(channels),
                "field": f"echo.{record}.{name}{suffix}",
                "direction": way,
            }
            channels.append(row | special.get(name, {}))
    machine = {
        "tick_hz": 100,
        "initial_state": "A",
        "algorithms": {"Echo": {"source": "echo.py"}},
        "instances": {"echo": {"algorithm": "Echo"}},
        "states": {"A": {"schedule": {"echo": 100}}},
        "channels": channels,
        "bus": {"payload": "cdr"},
    }
    (folder / "echo.json").write_text(json.dumps(machine))
    return folder / "echo.json"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("echo")
    config = machine_files(folder)
    done = subprocess.run(["fcslc", "build", config, "-o", folder], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "libecho.so"


def std(name: str, value: Any) -> bytes:
    kind = f"std_msgs/msg/{name}"
    if name.endswith("MultiArray"):
        layout = T["std_msgs/msg/MultiArrayLayout"]([], 0)
        value = np.array(value, name.removesuffix("MultiArray").lower())
        return bytes(STORE.serialize_cdr(T[kind](layout, value), kind))
    return bytes(STORE.serialize_cdr(T[kind](value), kind))


def imu(rate: Sequence[float], frame: str = "imu_link") -> bytes:
    vector, none = T["geometry_msgs/msg/Vector3"], np.zeros(9)
    header = T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](0, 0), frame)
    level = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    message = T["sensor_msgs/msg/Imu"](header, level, none, vector(*rate), none, vector(0.0, 0.0, 0.0), none)
    return bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/Imu"))


GOOD = {name: std(kind, value) for name, (kind, _, value) in zip(NAMES, KINDS, strict=True)}
GOOD |= {"packet": std("UInt8MultiArray", [7, 0, 255]), "rate": imu((1.0, 2.0, 3.0)), "level": std("Int16", 100)}


def read(kind: str, message: bytes) -> Any:
    return STORE.deserialize_cdr(message, kind)


class Simulator:
    """The other end of docs/reference/transports.md, with fcsl-fc as its controller."""

    def __init__(self, library: Path, folder: Path):
        endpoint = free_endpoint()
        config = zenoh.Config.from_json5('{mode: "peer", scouting: {multicast: {enabled: false}}}')
        config.insert_json5("listen/endpoints", f'["{zenoh_locator(endpoint)}"]')
        self.summary = folder / "summary.json"
        self._bus = zenoh.open(config)
        self._came: dict[str, queue.Queue[bytes]] = {}
        for name in ("@control", "tick", *(f"{name}_out" for name in GOOD)):
            self._came[name] = queue.Queue()
            self._subscribe(name)
        line = [
            PROGRAM,
            str(library),
            "--hal",
            f"zenoh:{endpoint}",
            "--timeout",
            "5",
            "--summary",
            str(self.summary),
        ]
        self.controller = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self._token = self._bus.liveliness().declare_token(f"echo/@simulator/{self._bus.zid()}")
        hello = self.take("@control")
        self._table = struct.unpack_from("<I", hello, 8)[0]
        self.put("@control", hello[:7] + b"\1" + hello[8:])
        self._tick = 0

    def _subscribe(self, name: str) -> None:
        def heard(sample: zenoh.Sample) -> None:
            self._came[name].put(bytes(sample.payload))

        self._bus.declare_subscriber(f"echo/{name}", heard, allowed_origin=zenoh.Locality.REMOTE)

    def put(self, name: str, data: bytes) -> None:
        self._bus.put(f"echo/{name}", data, congestion_control=zenoh.CongestionControl.BLOCK)

    def take(self, name: str) -> bytes:
        return self._came[name].get(timeout=LONG_S)

    def commit(self, names: Sequence[str]) -> None:
        order = list(GOOD)
        bits = sum(1 << order.index(name) for name in names)
        count = 2 * len(order)
        head = struct.pack("<QQIBBH", self._tick, self._tick * 10_000_000, self._table, 0, 0, count)
        self.put("tick", head + bits.to_bytes((count + 7) // 8, "little"))
        self._tick += 1

    def fly(self, values: dict[str, bytes]) -> dict[str, bytes]:
        """A tick with these values; the answers."""
        for name, data in values.items():
            self.put(name, data)
        self.commit(list(values))
        commit = self.take("tick")
        assert int.from_bytes(commit[:8], "little") == self._tick - 1 and commit[20] == 1
        return {name: self.take(f"{name}_out") for name in GOOD}

    def end(self) -> tuple[str, dict[str, int]]:
        """Ends the run; what the controller said, and the counters of its bus."""
        self.put("@control", b"FCSW\1\0\3" + bytes(13))
        return self.ended()

    def ended(self) -> tuple[str, dict[str, int]]:
        said, _ = self.controller.communicate(timeout=LONG_S)
        return said, json.loads(self.summary.read_text())["hal"]

    def close(self) -> None:
        self.controller.kill()
        self.controller.wait()
        self._bus.close()


@pytest.fixture
def simulator(library: Path, tmp_path: Path) -> Iterator[Simulator]:
    made = Simulator(library, tmp_path)
    yield made
    made.close()


def test_messages_of_every_type(simulator: Simulator) -> None:
    """What rosbags writes the machine reads, and the other way round."""
    simulator.fly({})
    answers = simulator.fly(GOOD)
    for name, (kind, _, value) in zip(NAMES, KINDS, strict=True):
        message = read(f"std_msgs/msg/{kind}", answers[name])
        got = message.data.tolist() if kind.endswith("MultiArray") else message.data
        assert got == value and answers[name] == GOOD[name], name
    assert read("std_msgs/msg/UInt8MultiArray", answers["packet"]).data.tolist() == [7, 0, 255]
    shown = read("sensor_msgs/msg/Imu", answers["rate"])
    stamp = shown.header.stamp
    assert (stamp.sec, stamp.nanosec) == (0, 10_000_000) and shown.header.frame_id == "imu_link"
    assert [getattr(shown.angular_velocity, axis) for axis in "xyz"] == [1.0, 2.0, 3.0]  # frd and back
    assert shown.orientation_covariance[0] == -1.0 and shown.orientation.w == 1.0
    odd = {"v6": std("Float64", math.nan), "v5": std("Float32", math.inf), "packet": std("UInt8MultiArray", [])}
    answers = simulator.fly(odd)
    assert math.isnan(read("std_msgs/msg/Float64", answers["v6"]).data)
    assert read("std_msgs/msg/Float32", answers["v5"]).data == math.inf
    assert len(read("std_msgs/msg/UInt8MultiArray", answers["packet"]).data) == 0
    said, hal = simulator.end()
    assert simulator.controller.returncode == 0, said
    assert hal["bus.values_refused"] == hal["bus.wrong_size"] == hal["bus.strays"] == 0


def test_a_value_that_its_message_cannot_hold_is_not_put(simulator: Simulator) -> None:
    simulator.fly(GOOD)
    simulator.put("level", std("Int16", 200))
    simulator.commit(["level"])
    bits = int.from_bytes(simulator.take("tick")[24:], "little")
    assert bits == (1 << 2 * len(GOOD)) - (1 << len(GOOD)) - (1 << 2 * len(GOOD) - 1)  # all actuators but the last one
    for name in list(GOOD)[:-1]:
        simulator.take(f"{name}_out")
    answers = simulator.fly({"level": std("Int16", -128)})
    assert read("std_msgs/msg/Int8", answers["level"]).data == -128
    said, hal = simulator.end()
    assert simulator.controller.returncode == 0 and hal["bus.values_refused"] == 1, said


def test_what_other_programs_add(simulator: Simulator) -> None:
    """Padding at the end, and the dimensions of an array, change nothing."""
    dimension = T["std_msgs/msg/MultiArrayDimension"]
    layout = T["std_msgs/msg/MultiArrayLayout"]([dimension("rows", 2, 6), dimension("columns", 3, 3)], 0)
    kind = "std_msgs/msg/Float64MultiArray"
    described = bytes(STORE.serialize_cdr(T[kind](layout, np.arange(6.0)), kind))
    answers = simulator.fly({"v0": GOOD["v0"] + bytes(3), "packet": GOOD["packet"] + bytes(1), "v13": described})
    assert answers["v0"] == GOOD["v0"] and answers["packet"] == GOOD["packet"]
    assert read(kind, answers["v13"]).data.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    said, _ = simulator.end()
    assert simulator.controller.returncode == 0, said


#: Dropped where they come, since no message of the channel has their size.
WRONG_SIZES = (
    ("v6", b""),
    ("v6", struct.pack("<d", 1.0)),  # raw
    ("v6", GOOD["v6"][:-1]),
    ("v6", GOOD["v6"] + bytes(8)),
    ("packet", GOOD["packet"][:15]),
    ("packet", std("UInt8MultiArray", [0] * 12)),
    ("rate", GOOD["rate"] + bytes(300)),
)


def test_messages_of_a_wrong_size_are_dropped(simulator: Simulator) -> None:
    simulator.fly(GOOD)
    for name, data in WRONG_SIZES:
        simulator.put(name, data)
    answers = simulator.fly({"v6": GOOD["v6"]})
    assert answers["v6"] == GOOD["v6"] and answers["packet"] == GOOD["packet"]
    said, hal = simulator.end()
    assert simulator.controller.returncode == 0, said
    assert hal["bus.wrong_size"] == len(WRONG_SIZES) and hal["bus.values_refused"] == 0


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("v6", b"\0\0" + GOOD["v6"][2:]),  # big-endian
        ("v6", b"\0\3" + GOOD["v6"][2:]),  # a parameter list
        ("v0", GOOD["v0"][:-1] + b"\2"),  # a bool of 2
        ("v7", std("UInt8MultiArray", [0, 2, 1])),
        ("v7", std("UInt8MultiArray", [0, 1])),
        ("v13", GOOD["v13"][:-1]),
        ("v13", GOOD["v13"] + bytes(8)),
        ("v13", GOOD["v13"][:4] + b"\xff" * (len(GOOD["v13"]) - 4)),
        ("packet", GOOD["packet"][:12] + b"\xff" * 7),
        ("packet", GOOD["packet"][:4] + b"\1" + GOOD["packet"][5:]),  # of a layout that is none
        ("rate", imu((1.0, 2.0, 3.0), "other")),
        ("rate", GOOD["rate"][:-20]),
    ],
)
def test_a_message_that_is_none_ends_the_run(simulator: Simulator, name: str, data: bytes) -> None:
    """It has a size that a message may have: the commit says that there is a value, and there is none."""
    simulator.fly(GOOD)
    simulator.put(name, data)
    simulator.commit([name])
    said, hal = simulator.ended()
    assert simulator.controller.returncode != 0 and hal["bus.values_refused"] == 1
    assert f"the commit of tick 1 says that channel '{name}' has a value, and what came is none" in said


# ---- fcsl bus ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def endpoint(library: Path) -> Iterator[str]:
    """Of a flight in real time that lasts as long as the tests."""
    where = free_endpoint()
    line = [PROGRAM, str(library), "--observers", where]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as fc:
        assert fc.stdout
        while "observers on" not in (said := fc.stdout.readline()):
            assert said, "the flight program ended"
        yield where
        fc.kill()


@pytest.fixture(scope="module")
def machine(endpoint: str) -> BusMachine:
    with Session(endpoint) as session:
        (found,), _ = session.machines()
    return found


def tool(*arguments: str | Path, status: int = 0) -> str:
    line = ["fcsl", "bus", *(str(a) for a in arguments)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=LONG_S, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout + done.stderr


def test_the_tools_show_the_values(endpoint: str) -> None:
    rows = {row.split()[0]: row for row in tool("list", "-c", endpoint, "-s", "0.2").splitlines()[1:]}
    assert "std_msgs/msg/Float64MultiArray" in rows["v13"] and "sensor_msgs/msg/Imu" in rows["rate"]
    told = [json.loads(line) for line in tool("echo", "-c", endpoint, "--json", "-n", "68").splitlines()]
    shown = {one["channel"]: one["value"] for one in told}
    assert shown["v0"] is False and shown["v13"] == [[0.0] * 3] * 2 and shown["rate"] == [0.0] * 3
    assert shown["packet"] == "" and shown["v4_out"] == 0


def test_values_there_and_back(machine: BusMachine) -> None:
    """What `put` puts is the message of rosbags, but for a stamp."""
    channels = {channel.name: channel for channel in machine.channels}
    for name, data in GOOD.items():
        channel = channels[name]
        values = channel.values(data)
        assert values is not None
        value = channel.decode(values)
        assert channel.values(channel.encode(value)) == values
        assert channel.values(data[:-1]) is None and channel.values(b"\0\0" + data[2:]) is None
        if name != "rate":
            assert channel.encode(value) == data
    with pytest.raises(BusError, match="whose `data` cannot hold this value"):
        channels["level_out"].encode(200)
    assert channels["rate"].decode(channels["rate"].values(imu((1.0, 2.0, 3.0))) or b"") == [1.0, -2.0, -3.0]
    assert channels["rate"].values(imu((1.0, 2.0, 3.0), "other")) is None


def test_messages_of_random_values() -> None:
    """Bit for bit there and back, for every scalar and any shape."""
    randomly = np.random.default_rng(5)
    formats = {"bool": "?", "i32": "i4", "i64": "i8", "u32": "u4", "u64": "u8", "f32": "f4", "f64": "f8"}
    for case in range(140):
        kind = list(formats)[case % 7]
        shape = tuple(randomly.integers(1, 5, size=case // 7 % 4).tolist())
        type_: Type = Array(SCALARS[kind], shape) if shape else SCALARS[kind]
        count = math.prod(shape)
        values = np.frombuffer(randomly.bytes(8 * count), formats[kind] if kind != "bool" else "u1")[:count]
        values = values & 1 if kind == "bool" else np.where(np.isnan(values), 0, values).astype(formats[kind])
        ros = standard_mapping(type_)
        payload = Payload("v", ros.type, ros.field, "", "", "", kind, count, is_blob=False)
        message = payload.write(values.tobytes())
        assert payload.read(message) == values.tobytes(), (kind, shape)
        got = read(full_name(ros.type), message).data
        assert np.array_equal(np.asarray(got).ravel(), values), (kind, shape)


def test_a_recording_has_the_values(endpoint: str, tmp_path: Path) -> None:
    line = ["fcsl", "bus", "record", "-c", endpoint, "-o", str(tmp_path / "bag")]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as recorder:
        assert recorder.stdout and "recording echo to" in recorder.stdout.readline()
        tool("echo", "-c", endpoint, "-n", "640")  # ten ticks of it
        recorder.terminate()
        recorder.communicate(timeout=LONG_S)
    assert recorder.returncode == 0
    rows = rows_of(Bag(tmp_path / "bag"), "/echo/v13_out")
    assert len(rows) > 0 and rows["value"].shape[1] == 6 and not rows["value"].any()


@pytest.mark.parametrize(
    "ros", [{"type": "acme/Odd"}, {"field": "nothing"}, {"axes": "up"}, {"frame": "no\nframe", "type": "std_msgs/Bool"}]
)
def test_a_descriptor_with_an_unknown_message(machine: BusMachine, ros: dict[str, str]) -> None:
    told = json.loads(machine.text)
    told["channels"][15]["ros"] |= ros  # that of the rate
    channel = read_machine("echo", json.dumps(told)).channels[15]
    with pytest.raises(ValueError, match="`"):
        channel.values(GOOD["rate"])
