# SPDX-License-Identifier: Apache-2.0
"""A machine's mapped channels: messages into a run with their own time and age, and out of it; the record replays them."""

from __future__ import annotations

import gc
import json
import math
import struct
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from simclient.bag import Bag
from simclient.errors import TwinError
from simclient.machine_build import build_config
from simclient.replay import replay
from simclient.ros.publish_queue import PublishQueue, RunTopics
from simclient.ros.topics import RosTopic, SampleInput, composer_of, reader_of, topics_of
from simclient.run import Run, open_run

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
MS = 1_000_000
SECOND = 1_000_000_000

ALGORITHM = '''class Show:
    """Shows what it is given."""

    inputs = {"rate": "f64[3] rad/s", "orientation": "f64[4]", "stick": "f32", "arm": "bool"}
    outputs = {"gyro": "f64[3] rad/s", "attitude": "f64[4]", "force": "f64[3] N", "mode": "i32"}

    def execute(self):
        self.gyro = self.rate
        self.attitude = self.orientation
        self.force = [1.0, 2.0, 3.0]
        self.mode = 200 if self.arm else 3
'''


def channel(name: str, number: int, port: str, direction: str, **ros: str) -> dict[str, Any]:
    more = {"max_age_ticks": 3} if direction == "sensor" else {}
    return {"name": name, "id": number, "field": f"show.{port}", "direction": direction, "ros": ros, **more}


IMU = {"type": "sensor_msgs/Imu", "frame": "imu_link"}
CHANNELS = [
    channel("imu.gyro", 1, "inputs.rate", "sensor", field="angular_velocity", axes="frd", **IMU),
    channel("stick", 2, "inputs.stick", "sensor", type="sensor_msgs/Joy", field="axes[1]", topic="/joy"),
    channel("imu.attitude", 3, "inputs.orientation", "sensor", field="orientation", axes="ned/frd", **IMU),
    channel("arm", 4, "inputs.arm", "sensor", type="sensor_msgs/Joy", field="buttons[0]", topic="/joy"),
    channel(
        "thrust.force",
        5,
        "outputs.force",
        "actuator",
        type="geometry_msgs/WrenchStamped",
        field="wrench.force",
        axes="frd",
    ),
    channel("mode", 6, "outputs.mode", "actuator", type="std_msgs/Int8", field="data"),
]


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mapped")
    (folder / "show.py").write_text(ALGORITHM)
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Show": {"source": "show.py"}},
        "instances": {"show": {"algorithm": "Show"}},
        "states": {"RUN": {"schedule": {"show": 100}}},
        "channels": CHANNELS,
    }
    (folder / "mapped.json").write_text(json.dumps(machine))
    return folder / "mapped.json"


@pytest.fixture
def run(config: Path) -> Iterator[Run]:
    library, name = build_config(config)
    opened = open_run(library, name)
    opened.attach()
    yield opened
    opened.close()


def value(run: Run, path: str) -> Any:
    field = run.machine.fields[path]
    types = {"f64": "f8", "f32": "f4", "bool": "?", "u32": "u4", "i64": "i8", "i32": "i4"}
    found = np.frombuffer(run.read(field.offset, field.size), types[field.type])
    return found.tolist() if field.shape else found[0].item()


def topic(run: Run, name: str) -> RosTopic:
    return next(t for t in topics_of(run.machine) if t.name == name)


def header(stamp_ns: int, frame: str) -> Any:
    time = T["builtin_interfaces/msg/Time"](stamp_ns // SECOND, stamp_ns % SECOND)
    return T["std_msgs/msg/Header"](time, frame)


def imu(
    stamp_ns: int, rate: float = 1.0, frame: str = "imu_link", measured: bool = True, half: float = math.sqrt(0.5)
) -> bytes:
    vector, quaternion = T["geometry_msgs/msg/Vector3"], T["geometry_msgs/msg/Quaternion"]
    covariance = np.array([0.0 if measured else -1.0, *[0.0] * 8])
    none = np.zeros(9)
    parts = (quaternion(0.0, 0.0, half, half), covariance, vector(rate, 2.0, 3.0), none, vector(0.0, 0.0, 9.8), none)
    return bytes(STORE.serialize_cdr(T["sensor_msgs/msg/Imu"](header(stamp_ns, frame), *parts), "sensor_msgs/msg/Imu"))


def joy(stamp_ns: int, axes: list[float], buttons: list[int]) -> bytes:
    message = T["sensor_msgs/msg/Joy"](header(stamp_ns, ""), np.array(axes, np.float32), np.array(buttons, np.int32))
    return bytes(STORE.serialize_cdr(message, "sensor_msgs/msg/Joy"))


def test_channels_of_a_topic_share_a_message(run: Run) -> None:
    found = [(t.name, t.type, t.frame, t.direction, [c.name for c in t.channels]) for t in topics_of(run.machine)]
    assert found == [
        ("imu", "sensor_msgs/msg/Imu", "imu_link", "sensor", ["imu.gyro", "imu.attitude"]),
        ("/joy", "sensor_msgs/msg/Joy", "", "sensor", ["stick", "arm"]),
        ("thrust", "geometry_msgs/msg/WrenchStamped", "", "actuator", ["thrust.force"]),
        ("mode", "std_msgs/msg/Int8", "", "actuator", ["mode"]),
    ]


def test_a_message_becomes_samples(run: Run) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    now = 5 * SECOND
    assert sample_input.deliver(imu(now - 25 * MS), now) == 2
    run.step(1)
    assert value(run, "show.outputs.gyro") == [1.0, -2.0, -3.0]
    assert np.allclose(value(run, "show.outputs.attitude"), [1.0, 0.0, 0.0, 0.0], atol=1e-15)  # facing north
    assert value(run, "channels.imu.gyro.stamp_ns") == now - 25 * MS
    assert value(run, "channels.imu.gyro.age_ticks") == 2 and value(run, "channels.imu.gyro.valid")
    run.step(2)  # no new one: it grows old, and invalid beyond max_age_ticks
    assert value(run, "channels.imu.gyro.age_ticks") == 4 and not value(run, "channels.imu.gyro.valid")
    assert sample_input.counts() == {"taken": 1}


def test_each_channel_is_taken_or_not(run: Run) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    assert sample_input.deliver(imu(SECOND, measured=False), SECOND) == 1
    assert sample_input.deliver(imu(SECOND + 1, rate=math.nan), SECOND + 1) == 1
    assert sample_input.deliver(imu(SECOND + 2, rate=math.nan, measured=False), SECOND + 2) == 0
    run.step(1)
    assert value(run, "show.outputs.gyro") == [1.0, -2.0, -3.0] and value(run, "show.outputs.attitude") != [0.0] * 4
    assert sample_input.counts() == {"taken": 2, "nan": 2, "unmeasured": 2}
    sample_input = SampleInput(run, topic(run, "/joy"))
    assert sample_input.deliver(joy(SECOND, [0.0, 0.25], [2]), SECOND) == 1
    assert sample_input.deliver(joy(SECOND + 1, [0.0], [1]), SECOND + 1) == 1
    run.step(1)
    assert value(run, "show.inputs.stick") == 0.25 and value(run, "show.inputs.arm") is True
    assert sample_input.counts() == {"taken": 2, "range": 1, "shape": 1}


def test_a_quaternion_of_length_zero_is_no_rotation(run: Run) -> None:
    """Unless the message says that it has none (REP-145): then nothing was to be refused."""
    sample_input = SampleInput(run, topic(run, "imu"))
    assert sample_input.deliver(imu(SECOND), SECOND) == 2
    run.step(1)
    before = value(run, "show.outputs.attitude")
    assert sample_input.deliver(imu(SECOND + 1, rate=4.0, half=0.0), SECOND + 1) == 1
    assert sample_input.deliver(imu(SECOND + 2, rate=5.0, half=-0.0), SECOND + 2) == 1
    assert sample_input.deliver(imu(SECOND + 3, rate=6.0, half=0.0, measured=False), SECOND + 3) == 1
    run.step(1)
    assert value(run, "show.outputs.attitude") == before and value(run, "show.outputs.gyro")[0] == 6.0
    assert sample_input.counts() == {"taken": 4, "rotation": 2, "unmeasured": 1}
    assert sample_input.deliver(imu(SECOND + 4, half=1e-300), SECOND + 4) == 2  # any other length is one


def test_a_missing_channel_gets_nothing_and_the_others_of_its_message_do(run: Run) -> None:
    """As in lock-step, where the frame lacks that channel alone."""
    sample_input = SampleInput(run, topic(run, "/joy"))
    assert sample_input.deliver(joy(SECOND, [0.0, 0.25], [1]), SECOND, frozenset({"stick", "imu.gyro"})) == 1
    run.step(1)
    assert value(run, "show.inputs.stick") == 0.0 and value(run, "show.inputs.arm") is True
    assert sample_input.deliver(joy(SECOND + 1, [0.0, 0.5], [0]), SECOND + 1, frozenset({"stick", "arm"})) == 0
    assert sample_input.deliver(joy(SECOND + 1, [0.0, 0.5], [0]), SECOND + 1) == 2, (
        "a message nothing was taken of is not known"
    )
    run.step(1)
    assert value(run, "show.inputs.stick") == 0.5 and value(run, "show.inputs.arm") is False
    assert sample_input.counts() == {"taken": 2}


def test_time_of_messages(run: Run) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    now = 100 * SECOND
    for stamp, at, written in (
        (now + 50 * MS, now, 2),  # ahead by 50 ms: clocks are never quite equal
        (now + 50 * MS, now + MS, 0),  # the same again
        (now + 49 * MS, now + MS, 0),  # an older one
        (now + 51 * MS + 1, now + MS, 0),  # ahead by more
        (0, now + MS, 2),  # no stamp: it is new
        (now + 50 * MS, now + MS, 0),  # which says nothing about the order of those that have one
        (now + 51 * MS, now + MS, 2),
        (now - SECOND, now - SECOND, 2),  # the clock was set back
        (now - SECOND, now, 0),
    ):
        assert sample_input.deliver(imu(stamp), at) == written, stamp - now
    assert sample_input.counts() == {"taken": 4, "future": 1, "older": 1, "repeated": 3}
    run.step(1)
    assert value(run, "channels.imu.gyro.age_ticks") == 0


@pytest.mark.parametrize(
    ("age_ns", "ticks"), [(0, 0), (10 * MS - 1, 0), (10 * MS, 1), (3 * SECOND, 300), (10**18, 2**32 - 1)]
)
def test_age_in_whole_ticks(run: Run, age_ns: int, ticks: int) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    assert sample_input.deliver(imu(SECOND), SECOND + age_ns) == 2
    run.step(1)
    assert value(run, "channels.imu.gyro.age_ticks") == ticks


def test_what_is_refused_changes_nothing(run: Run) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    before = run.save()
    good = imu(SECOND)
    bad = {
        "encoding": b"\0\0" + good[2:],
        "truncated": good[:-1],
        "malformed": good[:24] + b"x" + good[25:],  # the NUL of imu_link
        "stamp": good[:8] + b"\xff" * 4 + good[12:],
        "frame": imu(SECOND, frame="imu"),
    }
    for data in (*bad.values(), b"", good[:3]):
        assert sample_input.deliver(data, SECOND) == 0
    assert run.save() == before
    assert sample_input.counts() == {"taken": 0, **dict.fromkeys(bad, 1), "truncated": 3}


def test_the_record_replays_them(config: Path, run: Run, tmp_path: Path) -> None:
    sample_input = SampleInput(run, topic(run, "imu"))
    run.record(tmp_path / "bag", "", lossless=True)
    for i in range(50):
        if i % 3:
            sample_input.deliver(imu(SECOND + i * 10 * MS, rate=float(i)), SECOND + i * 10 * MS + 15 * MS * (i % 4))
        run.step(1)
    run.record_stop()
    verdict = replay(tmp_path / "bag", config=str(config))
    assert verdict.identical and verdict.ticks == 50


def test_messages_out_of_a_machine(run: Run) -> None:
    thrust, mode = composer_of(topic(run, "thrust")), composer_of(topic(run, "mode"))
    run.step(1)
    data = thrust.compose([run.address], 7 * SECOND + 5)
    assert data is not None
    message = STORE.deserialize_cdr(data, "geometry_msgs/msg/WrenchStamped")
    force, stamp = message.wrench.force, message.header.stamp
    assert (force.x, force.y, force.z, stamp.sec, stamp.nanosec) == (1.0, -2.0, -3.0, 7, 5)
    data = mode.compose([run.address], 0)
    assert data is not None and STORE.deserialize_cdr(data, "std_msgs/msg/Int8").data == 3
    arm = next(c for c in run.machine.channels if c.name == "arm")
    run.write_channel(arm.index, b"\1")
    run.step(1)
    assert mode.compose([run.address], 0) is None and mode.refused == 1  # 200 is no int8


def test_what_a_run_shows_is_its_record_with_the_stamps_of_the_host(run: Run, tmp_path: Path) -> None:
    """Messages of an instance, of a tick, and of channels; before 1970, and until an int32 of seconds ends."""
    stamps_ns = [-1, 0, -SECOND, -1_500_000_000, -SECOND - 1, SECOND - 1, SECOND, 7 * SECOND + 5, 2**31 * SECOND - 1]
    show, state, health, thrust = range(3, 7)
    queue = PublishQueue(lossless=True)
    topics = RunTopics(run, queue)
    topics.add_instance(show, 0, 2)
    topics.add_tick_message(state, "state")
    topics.add_tick_message(health, "health")
    topics.add_channels(thrust, "actuator", composer_of(topic(run, "thrust")))
    run.record(tmp_path / "bag", "", lossless=True)
    topics.put_changes(stamps_ns[3])
    shown = [(name, stamps_ns[3], data) for name, data in queue.take(wait=False)]
    for stamp in stamps_ns:
        run.step(1)
        topics.put(stamp)
        shown += [(name, stamp, data) for name, data in queue.take(wait=False)]
    run.record_stop()
    times = [second * SECOND + nanosecond for _, _, data in shown for second, nanosecond in [unpack(data)]]
    assert times == [stamp for _, stamp, _ in shown]
    assert [name for name, _, _ in shown[:2]] == [state, health]
    recorded: dict[str, list[bytes]] = {}
    for name, _, data in Bag(tmp_path / "bag").messages():
        recorded.setdefault(name.rpartition("/")[2], []).append(bytes(data))
    contents_of = {n: [data[:4] + data[12:] for name, _, data in shown if name == n] for n in range(3, 7)}
    assert contents_of[show] == [data[:4] + data[12:] for data in recorded["show"][::2]] and len(recorded["show"]) == 9
    for name, words in ((state, "state"), (health, "health")):  # where more than the tick has changed
        changes = [content for content, _ in groupby(data[28:] for data in recorded[words])]
        assert [data[20:] for data in contents_of[name]][-len(changes) :] == changes, words
    assert topics.refused(thrust) == 4 and len(contents_of[thrust]) == len(stamps_ns) - 4  # ROS has no time before 1970
    topics.close()
    queue.close()


def unpack(data: bytes) -> tuple[int, int]:
    """Seconds and nanoseconds of a header at the beginning."""
    second, nanosecond = struct.unpack_from("<iI", data, 4)
    assert nanosecond < SECOND
    return second, nanosecond


def test_a_simulator_makes_the_topics_that_the_machine_takes(run: Run) -> None:
    """composer_of a sensor topic, out of a block like the machine's struct, is what reader_of reads."""
    taken = topic(run, "imu")
    block = np.zeros(run.machine.size, np.uint8)
    for at, number in zip(taken.channels, ([0.5, -0.25, 8.0], [0.5, 0.5, -0.5, 0.5]), strict=True):
        data = np.array(number).view(np.uint8)
        block[at.field.offset : at.field.offset + len(data)] = data
    data = composer_of(taken).compose([block.ctypes.data], 3)
    assert data is not None
    samples = reader_of(taken).read_many(data, [0], [len(data)])
    assert samples.values["imu.gyro"][0].tolist() == [0.5, -0.25, 8.0]
    assert np.allclose(samples.values["imu.attitude"][0], [0.5, 0.5, -0.5, 0.5], atol=1e-15)
    assert samples.stamps[0] == 3 and not samples.status.any()


def test_a_topic_of_another_machine_is_refused(run: Run) -> None:
    """Whose channels this one does not have, or has otherwise."""
    imu_topic = topic(run, "imu")
    gyro, attitude = imu_topic.channels
    for channels, reason in (
        ((replace(gyro, index=99), attitude), "no sensor channel number 99"),
        (
            (replace(gyro, index=attitude.index), attitude),
            "channel 'imu.attitude' has 32 bytes, its value in the message 24",
        ),
        ((replace(gyro, index=topic(run, "thrust").channels[0].index), attitude), "no sensor channel number"),
    ):
        with pytest.raises(TwinError, match=reason):
            SampleInput(run, replace(imu_topic, channels=channels))


def test_a_closed_run_is_an_error(config: Path) -> None:
    library, name = build_config(config)
    run = open_run(library, name)
    sample_input = SampleInput(run, topic(run, "imu"))
    run.close()
    with pytest.raises(TwinError, match="closed"):
        sample_input.deliver(imu(SECOND), SECOND)
    with pytest.raises(TwinError, match="closed"):
        _ = run.address
    assert sample_input.counts() == {"taken": 0}
    del sample_input
    gc.collect()
