# SPDX-License-Identifier: Apache-2.0
"""Bags written by the runtime, read by two independent readers."""

from __future__ import annotations

import math
import re
import struct
import textwrap
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from native import ARMED, COUNT, FIXTURE, GYRO, NEGATIVE, TEMPERATURE, Refused, Run
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.metadata import parse_qos
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from simclient.run import open_run

SET, SET_STATE, RESTORE, CHANNEL, OVERRUN, ATTACH = range(6)
MESSAGES = Path(__file__).resolve().parents[3] / "fcsl_msgs/msg"


def read(bag: Path) -> dict[str, list[tuple[int, Any]]]:
    """Messages by topic: (log time, decoded message)."""
    messages: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with AnyReader([bag]) as reader:
        for connection, time_ns, data in reader.messages():
            messages[connection.topic].append((time_ns, reader.deserialize(data, connection.msgtype)))
    return messages


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A flight with every kind of write and event, recorded under namespace veh."""
    path = tmp_path / "flight"
    run = Run()
    run.record(path, "veh")
    run.set(GYRO, struct.pack("<3d", 1.5, -2.0, math.nan))
    run.set(TEMPERATURE, struct.pack("<f", 293.5))
    run.step(3)
    run.set(ARMED, b"\1")
    run.step(2)
    run.call("fcsl_run_set_state", 0)
    run.call("fcsl_run_inject_overrun", 1)
    run.set(GYRO, struct.pack("<d", 0.25), 1)
    run.step(1)
    run.call("fcsl_run_attach")
    run.set(COUNT, struct.pack("<q", -1))
    run.step(8)
    run.call("fcsl_run_close")
    return path


def test_named_fields(bag: Path) -> None:
    messages = read(bag)
    pilot = messages["/veh/fixture/pilot"]
    assert [(time_ns, m.tick) for time_ns, m in pilot] == [(k * 10_000_000, k) for k in range(14)]
    assert all(m.header.stamp.sec * 10**9 + m.header.stamp.nanosec == t and m.header.frame_id == "" for t, m in pilot)
    first = pilot[0][1]
    assert first.force == 2.0 * 1.5 - 0.25 and first.runs == 1 and first.sign == 1 and first.saturated is False
    assert first.matrix.tolist() == [0.0, first.force, 293.5, 0.0]
    assert pilot[3][1].transition_request == 1 and pilot[5][1].health == 1
    sensors = messages["/veh/fixture/sensors"][0][1]
    assert sensors.gyro[0] == 1.5 and math.isnan(sensors.gyro[2]) and sensors.count == 0


def test_states_and_events(bag: Path) -> None:
    messages = read(bag)
    states = [(m.tick, m.state, m.next_state) for _, m in messages["/veh/fixture/state"]]
    assert states[2:8] == [
        (2, "IDLE", "IDLE"),
        (3, "IDLE", "ACTIVE"),
        (4, "ACTIVE", "ACTIVE"),
        (5, "IDLE", "ACTIVE"),
        (6, "ACTIVE", "ACTIVE"),
        (7, "ACTIVE", "IDLE"),
    ]
    events = [
        (m.tick, m.from_state, m.to_state, m.request, m.instance) for _, m in messages["/veh/fixture/transitions"]
    ]
    assert events == [
        (3, "IDLE", "ACTIVE", "GO", "pilot"),
        (5, "ACTIVE", "IDLE", "", ""),  # forced by the host
        (5, "IDLE", "ACTIVE", "GO", "pilot"),
        (7, "ACTIVE", "IDLE", "", ""),  # the health guard
    ]
    health = {m.tick: m.health.tolist() for _, m in messages["/veh/fixture/health"]}
    # On change only: once at the start, degraded by the overrun, waiting for samples, faulting. Both states schedule both
    # instances, which go on.
    assert health[0] == [0, 0] and health[5] == [0, 1] and health[6] == [1, 1] and health[7] == [1, 2]
    assert not {1, 2, 3, 4} & set(health)
    faults = {m.tick: (m.faults.tolist(), m.overruns.tolist()) for _, m in messages["/veh/fixture/faults"]}
    assert faults[0] == ([0, 0], [0, 0]) and faults[5] == ([0, 0], [0, 1]) and faults[7] == ([0, 1], [0, 1])
    places = {m.tick: m.fault_place for _, m in messages["/veh/fixture/faults"]}
    assert places[5] == ["", ""] and places[7] == ["", NEGATIVE]


def test_a_state_that_is_set_anew_is_a_write_and_no_transition(tmp_path: Path) -> None:
    run = Run()
    run.record(tmp_path / "flight")
    run.step(1)
    run.call("fcsl_run_set_state", 0)  # it is IDLE already
    run.step(1)
    run.call("fcsl_run_close")
    messages = read(tmp_path / "flight")
    writes = [(m.tick, m.kind, m.path) for _, m in messages["/fixture/record/writes"]]
    assert writes == [(1, SET_STATE, "IDLE")] and messages["/fixture/transitions"] == []
    assert [m.state for _, m in messages["/fixture/state"]] == ["IDLE", "IDLE"]


def test_writes_reproduce_the_run(bag: Path) -> None:
    messages = read(bag)
    writes = [(m.tick, m.kind, m.path, m.element, m.data.tobytes()) for _, m in messages["/veh/fixture/record/writes"]]
    nan = bytes.fromhex("000000000000f87f")
    assert writes == [
        (0, SET, "sensors.outputs.gyro", 0, struct.pack("<2d", 1.5, -2.0) + nan),
        (0, SET, "sensors.outputs.temperature", 0, struct.pack("<f", 293.5)),
        (3, SET, "sensors.outputs.armed", 0, b"\1"),
        (5, SET_STATE, "IDLE", 0, b""),
        (5, OVERRUN, "pilot", 0, b""),
        (5, SET, "sensors.outputs.gyro", 1, struct.pack("<d", 0.25)),
        (6, ATTACH, "", 0, b""),
        (6, SET, "sensors.outputs.count", 0, struct.pack("<q", -1)),
    ]
    ((time_ns, checkpoint),) = messages["/veh/fixture/record/checkpoint"]
    assert (time_ns, checkpoint.tick, checkpoint.machine) == (0, 0, "fixture")
    machine = open_run(Path(FIXTURE), None).machine
    hashes = {"source_hash", "layout_hash", "build_hash"}
    assert len({getattr(machine, name) for name in hashes}) == 3
    assert all(getattr(checkpoint, name) == getattr(machine, name) for name in hashes)
    assert len(checkpoint.data) == machine.size

    # The same writes at the same ticks give the same messages, bit for bit.
    run = Run()
    with AnyReader([bag]) as reader:
        recorded = [data for c, _, data in reader.messages() if c.topic == "/veh/fixture/pilot"]
    fields = {"sensors.outputs.gyro": GYRO, "sensors.outputs.temperature": TEMPERATURE}
    fields |= {"sensors.outputs.armed": ARMED, "sensors.outputs.count": COUNT}
    for tick, expected in enumerate(recorded):
        for _, kind, path, element, data in (w for w in writes if w[0] == tick):
            if kind == SET:
                run.set(fields[path], data, element)
            elif kind == SET_STATE:
                run.call("fcsl_run_set_state", 0)
            elif kind == OVERRUN:
                run.call("fcsl_run_inject_overrun", 1)
            else:
                run.call("fcsl_run_attach")
        run.step(1)
        assert run.message(1) == bytes(expected)
    run.call("fcsl_run_close")


def test_mcap_reader(bag: Path) -> None:
    with (bag / "flight_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        topics = {channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()}
        assert topics["/veh/fixture/pilot"].name == "fcsl_runtime/msg/FixturePilot"
        assert all(schema.encoding == "ros2msg" for schema in topics.values())
        assert all(m.log_time == m.publish_time for _, _, m in reader.iter_messages())
        sequences: dict[int, list[int]] = defaultdict(list)
        for _, channel, message in reader.iter_messages():
            sequences[channel.id].append(message.sequence)
        assert all(numbers == list(range(len(numbers))) for numbers in sequences.values())


def test_metadata_as_rosbags_writes_it(bag: Path, tmp_path: Path) -> None:
    """Every key that rosbags' own writer makes, with values of the same types, and counts that are true."""
    store = get_typestore(Stores.ROS2_JAZZY)
    ours = yaml.safe_load((bag / "metadata.yaml").read_text())
    topics = ours["rosbag2_bagfile_information"]["topics_with_message_count"]
    qos = parse_qos(topics[0]["topic_metadata"]["offered_qos_profiles"])
    with Writer(tmp_path / "other", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/a", "std_msgs/msg/Header", typestore=store, offered_qos_profiles=qos)
        message = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "")
        writer.write(connection, 0, store.serialize_cdr(message, "std_msgs/msg/Header"))

    def shape(value: object) -> object:
        if isinstance(value, dict):
            return {key: shape(member) for key, member in value.items()}
        if isinstance(value, list):
            return [shape(value[-1])] if value else []
        return type(value).__name__

    theirs = yaml.safe_load((tmp_path / "other/metadata.yaml").read_text())
    assert shape(ours) == shape(theirs)
    information = ours["rosbag2_bagfile_information"]
    messages = read(bag)
    assert information["message_count"] == sum(map(len, messages.values()))
    assert information["relative_file_paths"] == ["flight_0.mcap"]
    assert information["duration"]["nanoseconds"] == 130_000_000
    for topic in information["topics_with_message_count"]:
        name = topic["topic_metadata"]["name"]
        assert topic["message_count"] == len(messages[name])
        durability = [qos["durability"] for qos in topic["topic_metadata"]["offered_qos_profiles"]]
        latched = name in ("/veh/fixture/state", "/veh/fixture/record/views")
        assert durability == ["transient_local" if latched else "volatile"]


def test_type_hashes(bag: Path) -> None:
    """The hashes are what rosbags computes for the definitions that the bag embeds."""
    store = get_typestore(Stores.ROS2_JAZZY)
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    hashes = {
        topic["topic_metadata"]["type"]: topic["topic_metadata"]["type_description_hash"]
        for topic in information["topics_with_message_count"]
    }
    with AnyReader([bag]) as reader:
        for connection in reader.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
        for name, value in hashes.items():
            assert value == store.hash_rihs01(name)


def declarations(text: str) -> list[str]:
    """Fields and constants of a message text in their order, constants first; without comments and dependencies."""
    lines = (" ".join(re.sub(r"#.*", "", line).split()) for line in text.split("=" * 80)[0].splitlines())
    return sorted(filter(None, lines), key=lambda line: "=" not in line)


def test_schemas_are_those_of_fcsl_msgs(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        embedded = {c.msgtype: c.msgdef.data for c in reader.connections if c.msgtype.startswith("fcsl_msgs/")}
    assert len(embedded) == 6
    for name, text in embedded.items():
        assert declarations(text) == declarations((MESSAGES / f"{name.split('/')[-1]}.msg").read_text())


def test_without_namespace_and_added_topic(tmp_path: Path) -> None:
    run = Run()
    run.record(tmp_path / "it's a bag/")
    schema = (
        b"std_msgs/Header header\nfloat64 altitude\n"
        + textwrap.dedent("""\
        ================================================================================
        MSG: std_msgs/Header
        builtin_interfaces/Time stamp
        string frame_id
        ================================================================================
        MSG: builtin_interfaces/Time
        int32 sec
        uint32 nanosec
        """).encode()
    )
    topic = run.call("fcsl_run_record_add_topic", b"/truth/plant", b"plant/msg/Truth", schema)
    cdr = b"\0\1\0\0" + struct.pack("<iII4xd", 1, 2, 1, 12.5)
    run.call("fcsl_run_record_write", topic, 5, cdr, len(cdr))
    for name in (b"/truth/plant", b"relative", b"/bad name"):
        with pytest.raises(Refused):
            run.call("fcsl_run_record_add_topic", name, b"plant/msg/Truth", schema)
    with pytest.raises(Refused):
        run.call("fcsl_run_record_write", topic + 1, 5, cdr, len(cdr))
    with pytest.raises(Refused):
        run.call("fcsl_run_record_write", 0, 5, cdr, len(cdr))  # the runtime's own topics are its own
    run.step(1)
    with pytest.raises(Refused, match="before the first step"):
        run.call("fcsl_run_record_add_topic", b"/late", b"plant/msg/Truth", schema)
    run.call("fcsl_run_close")
    messages = read(tmp_path / "it's a bag")
    assert "/fixture/pilot" in messages
    ((time_ns, truth),) = messages["/truth/plant"]
    assert time_ns == 5 and truth.altitude == 12.5 and truth.header.stamp.sec == 1


def test_existing_bag_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    run = Run()
    with pytest.raises(Refused, match="exists already"):
        run.record(tmp_path / "bag")
    with pytest.raises(Refused, match="cannot create"):
        run.record(tmp_path / "no/such/folder")
    assert not list((tmp_path / "bag").iterdir())
    run.record(tmp_path / "good")  # a refused recording leaves the run as it was
    run.step(1)
    run.call("fcsl_run_close")
    assert read(tmp_path / "good")["/fixture/pilot"]


def test_lossless_drops_nothing(tmp_path: Path) -> None:
    run = Run()
    run.record(tmp_path / "bag")
    run.step(60_000)  # about three times what the ring holds
    assert run.dropped() == 0
    run.call("fcsl_run_close")
    with AnyReader([tmp_path / "bag"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts["/fixture/pilot"] == counts["/fixture/state"] == 60_000


def test_real_time_never_waits(tmp_path: Path) -> None:
    """What does not fit the ring is dropped and counted, and everything is accounted for."""
    run = Run()
    run.record(tmp_path / "bag", lossless=False)
    run.step(200_000)
    dropped = run.dropped()
    run.call("fcsl_run_close")
    with AnyReader([tmp_path / "bag"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts["/fixture/state"] + dropped == 200_000 and dropped > 0
    assert counts["/fixture/pilot"] == counts["/fixture/pilot/inputs"] == counts["/fixture/state"]
