# SPDX-License-Identifier: Apache-2.0
"""The table of standard messages, and reading and composing each of them, compared with rosidl's definitions and
rclpy's serialization."""

from __future__ import annotations

import ctypes
import json
import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from fcsl_bridge.topics.interfaces import message_class
from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.ros.composer import Source
from fcsl_compiler.ros.message_fields import fields_of, select
from fcsl_compiler.ros.reader import Pick
from fcsl_compiler.ros.standard_messages import SIZES, STANDARD, SUPPORTED, Definitions
from simclient.ros.composer import Composer
from simclient.ros.reader import REASONS, Reader, Samples

#: Numbers of type_description_interfaces/FieldType.
NUMBERS = {2: "int8", 3: "uint8", 4: "int16", 5: "uint16", 6: "int32", 7: "uint32", 8: "int64", 9: "uint64"}
NUMBERS |= {10: "float32", 11: "float64", 15: "bool", 16: "byte", 17: "string"}
ARRAY, SEQUENCE = 48, 144
#: A machine's type for each number type of a message.
WIDEST = {"bool": "bool", "float32": "f32", "float64": "f64"}
CODES = {"bool": "?", "f32": "f", "f64": "d", "i64": "q", "u64": "Q"}


def described(name: str) -> dict[str, list[tuple[str, str, int, bool]]]:
    """rosidl's definition of a message and its nested messages: name, type, count and whether it is a sequence, by
    member.
    """
    package, _, bare = name.split("/")
    path = package_prefix(package) / "share" / package / "msg" / f"{bare}.json"
    message = json.loads(path.read_text())["type_description_msg"]
    found = {}
    for description in (message["type_description"], *message["referenced_type_descriptions"]):
        members = []
        for field in description["fields"]:
            kind = field["type"]["type_id"]
            base = kind % ARRAY
            type_ = field["type"]["nested_type_name"] if base == 1 else NUMBERS[base]
            members.append((field["name"], type_, field["type"]["capacity"], kind >= SEQUENCE))
        found[description["type_name"]] = members
    return found


@pytest.mark.parametrize("name", SUPPORTED)
def test_the_table_is_rosidls(name: str) -> None:
    for held, members in described(name).items():
        assert [(m.name, m.type, m.count, m.sequence) for m in STANDARD[held]] == members


def test_every_supported_message_can_be_mapped() -> None:
    for name in SUPPORTED:
        fields = [field.replace("<name>", "joint") for field in fields_of(STANDARD, name)]
        assert fields and all(select(STANDARD, name, field).pieces for field in fields)


# ---- random messages ----------------------------------------------------------------------------------------------------


@dataclass
class Leaf:
    """A number or a list of them in a message, with its values."""

    path: str
    type: str
    values: list[Any]

    @property
    def scalar(self) -> str:
        return WIDEST.get(self.type) or ("u64" if self.type.startswith("u") else "i64")


class Random:
    """Fills messages with distinct values."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)

    def number(self, type_: str) -> Any:
        if type_ == "bool":
            return bool(self.rng.integers(2))
        if type_.startswith("float"):
            number = float(
                self.rng.choice([self.rng.normal() * 10.0 ** self.rng.integers(-30, 30), math.inf, -0.0, 5e-324])
            )
            return float(np.float32(number)) if type_ == "float32" else number
        bits = 8 * SIZES[type_]
        low, high = (0, 2**bits - 1) if type_.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return (low, high, int(self.rng.integers(low, high, dtype=type_, endpoint=True)))[self.rng.integers(3)]

    def text(self) -> str:
        return "".join(self.rng.choice(list("abcd_/é"), self.rng.integers(0, 9)))

    def fill(self, message: Any, name: str) -> None:
        """Fills all members but the header's stamp; joints get distinct names."""
        joints = int(self.rng.integers(0, 5))
        for member in STANDARD[name]:
            count = member.count or (int(self.rng.integers(0, 5)) if member.sequence else 1)
            if name.endswith("JointState") and member.sequence:
                count = joints
            if member.type in SIZES:
                values: Any = [self.number(member.type) for _ in range(count)]
            elif member.type == "string":
                values = [f"joint_{i}" if member.sequence else self.text() for i in range(count)]
            else:
                values = [message_class(member.type)() for _ in range(count)]
                for value in values:
                    self.fill(value, member.type)
            setattr(message, member.name, values if member.is_array else values[0])
        if name == "builtin_interfaces/msg/Time":
            message.sec, message.nanosec = int(self.rng.integers(0, 2**31)), int(self.rng.integers(0, 10**9))

    def message(self, name: str) -> Any:
        message = message_class(name)()
        self.fill(message, name)
        if name.endswith("NavSatFix"):
            message.status.status = 0  # -1 means that nothing was measured
        return message


def leaves(definitions: Definitions, name: str, message: Any, prefix: str = "") -> list[Leaf]:
    """The numbers of a message, except those of its header."""
    found: list[Leaf] = []
    for member in definitions[name]:
        value, path = getattr(message, member.name), prefix + member.name
        if member.type in SIZES:
            values = list(value) if member.is_array else [value]
            found += [Leaf(path, member.type, values)] if values else []
        elif member.is_array and member.type != "string":
            for i, one in enumerate(value):
                found += leaves(definitions, member.type, one, f"{path}[{i}].")
        elif member.type != "string" and path != "header":
            found += leaves(definitions, member.type, value, path + ".")
    return found


def equal(a: Any, b: Any) -> bool:
    """Equality; floats are compared bit for bit."""
    return a == b and math.copysign(1, a) == math.copysign(1, b) if isinstance(a, float) else bool(a == b)


def read(name: str, message: Any, picks: list[Pick]) -> Samples:
    data = serialize_message(message)
    return Reader(STANDARD, name, picks).read_many(b"?" * 3 + data, [3], [len(data)])


@pytest.mark.parametrize("name", SUPPORTED)
def test_reading_what_rclpy_wrote(name: str) -> None:
    for seed in range(20):
        message = Random(seed).message(name)
        found = leaves(STANDARD, name, message)
        picks = [Pick(leaf.path, (leaf.path,), leaf.scalar, len(leaf.values)) for leaf in found]
        samples = read(name, message, picks)
        for leaf in found:
            column = samples.values[leaf.path][0]
            got = column.tolist() if len(leaf.values) > 1 else [column.item()]
            assert all(map(equal, got, leaf.values)), leaf
        assert not samples.status.any()
        if hasattr(message, "header"):
            stamp = message.header.stamp
            assert samples.stamps[0] == stamp.sec * 10**9 + stamp.nanosec


@pytest.mark.parametrize("name", SUPPORTED)
def test_cut_and_damaged_messages(name: str) -> None:
    """Each truncation is detected, except of the bytes that rclpy appends to a message; damage never crashes the
    reader.
    """
    random = Random(3)
    message = random.message(name)
    found = leaves(STANDARD, name, message)
    reader = Reader(STANDARD, name, [Pick(leaf.path, (leaf.path,), leaf.scalar, len(leaf.values)) for leaf in found])
    data = serialize_message(message)
    samples = reader.read_many(data, np.zeros(len(data), int), range(len(data)))
    truncated = (samples.status == REASONS.index("truncated")).all(axis=1)
    assert truncated[: len(data) - 8].all() and (np.diff(truncated.astype(int)) <= 0).all()
    assert (samples.status[~truncated] == 0).all()
    noise = random.rng.integers(0, 256, (300, len(data)), dtype=np.uint8)
    kept = random.rng.random((300, len(data))) < 0.95
    damaged = np.where(kept, np.frombuffer(data, np.uint8), noise)
    samples = reader.read_many(damaged, np.arange(300) * len(data), np.full(300, len(data)))
    assert (samples.status < REASONS.index("future")).all()


def memory_of(found: list[Leaf]) -> tuple[ctypes.Array[ctypes.c_char], list[Source]]:
    """The leaves in memory, as in a machine struct, and their sources."""
    data, sources = bytearray(), []
    for leaf in found:
        code = CODES[leaf.scalar]
        data += bytes(-len(data) % struct.calcsize(code))
        sources.append(Source(leaf.path, leaf.scalar, len(leaf.values), len(data)))
        data += struct.pack(f"={len(leaf.values)}{code}", *leaf.values)
    return ctypes.create_string_buffer(bytes(data), max(1, len(data))), sources


def named(leaf: Leaf) -> list[Leaf]:
    """Names the elements of a JointState by joint."""
    return [Leaf(f"{leaf.path}[joint_{i}]", leaf.type, [value]) for i, value in enumerate(leaf.values)]


def blank(message: Any, name: str) -> None:
    """Clears texts that cannot be mapped."""
    for member in STANDARD[name]:
        value = getattr(message, member.name)
        if member.type == "string" and not member.is_array:
            setattr(message, member.name, "")
        elif member.type in STANDARD:
            for one in value if member.is_array else [value]:
                blank(one, member.type)


@pytest.mark.parametrize("name", SUPPORTED)
def test_rclpy_reads_what_was_composed(name: str) -> None:
    for seed in range(20):
        message = Random(seed).message(name)
        blank(message, name)
        found = leaves(STANDARD, name, message)
        if name.endswith("JointState"):
            found = [one for leaf in found for one in named(leaf)]
        memory, sources = memory_of(found)
        frames = {}
        if hasattr(message, "header"):
            message.header.frame_id = frames["frame"] = "imu_link"
        if hasattr(message, "child_frame_id"):
            message.child_frame_id = frames["child_frame"] = "base/é"
        stamp = message.header.stamp if hasattr(message, "header") else None
        time_ns = stamp.sec * 10**9 + stamp.nanosec if stamp else 7
        data = Composer(STANDARD, name, sources, **frames).compose([ctypes.addressof(memory)], time_ns)
        assert data is not None
        got = deserialize_message(data, message_class(name))
        assert got == message
        assert all(map(equal, flat(name, got), flat(name, message)))


def flat(name: str, message: Any) -> list[Any]:
    return [v.item() if hasattr(v, "item") else v for leaf in leaves(STANDARD, name, message) for v in leaf.values]


@pytest.mark.parametrize("name", SUPPORTED)
def test_what_nothing_fills_is_rosidls_default(name: str) -> None:
    """Except where the message's documentation defines markers for missing values."""
    unknown = {
        "sensor_msgs/msg/Imu": [-1.0 if i % 9 == 0 else 0.0 for i in range(27)],
        "sensor_msgs/msg/MagneticField": [math.nan] * 3,
        "sensor_msgs/msg/NavSatFix": [math.nan],
        "sensor_msgs/msg/BatteryState": [math.nan] * 6,
        **{
            f"geometry_msgs/msg/{what}WithCovariance{stamped}": [-1.0]
            for what in ("Pose", "Twist")
            for stamped in ("", "Stamped")
        },
        "nav_msgs/msg/Odometry": [-1.0] * 2,
    }.get(name, [])
    data = Composer(STANDARD, name, []).compose([0], 0)
    assert data is not None
    got = flat(name, deserialize_message(data, message_class(name)))
    default = flat(name, message_class(name)())
    differing = [a for a, b in zip(got, default, strict=True) if not equal(a, b)]
    assert repr(differing) == repr([u for u in unknown if u != 0.0])


# ---- validity, joints, frames ----------------------------------------------------------------------------------------


def test_measured_or_not() -> None:
    imu = Random(1).message("sensor_msgs/msg/Imu")
    imu.orientation_covariance[0] = -1.0
    picks = [Pick("q", ("orientation",), "f64", 4), Pick("w", ("angular_velocity.x",), "f64")]
    samples = read("sensor_msgs/msg/Imu", imu, picks)
    assert [REASONS[s] for s in samples.status[0]] == ["unmeasured", "taken"]
    fix = Random(1).message("sensor_msgs/msg/NavSatFix")
    fix.status.status = -1
    picks = [Pick("h", ("altitude",), "f64"), Pick("s", ("status.status",), "i32")]
    samples = read("sensor_msgs/msg/NavSatFix", fix, picks)
    assert [REASONS[s] for s in samples.status[0]] == ["unmeasured", "taken"]


def test_joints_in_any_order() -> None:
    joints = message_class("sensor_msgs/msg/JointState")(name=["b", "ä", "c"], position=[1.0, 2.0, 3.0], velocity=[4.0])
    paths = ["position[c]", "position[ä]", "velocity[b]", "velocity[c]", "effort[b]", "position[d]"]
    samples = read("sensor_msgs/msg/JointState", joints, [Pick(path, (path,), "f64") for path in paths])
    assert samples.values[0].tolist() == (3.0, 2.0, 4.0, 0.0, 0.0, 0.0)
    assert [REASONS[s] for s in samples.status[0]] == ["taken"] * 3 + ["shape"] * 3


def test_frames() -> None:
    odometry = message_class("nav_msgs/msg/Odometry")(child_frame_id="base_link")
    odometry.header.frame_id = "odom"
    data = serialize_message(odometry)
    pick = [Pick("z", ("pose.pose.position.z",), "f64")]
    for frame, child, result in (
        ("odom", "base_link", "taken"),
        ("", "base_link", "taken"),
        ("odom", "base", "frame"),
        ("odo", "", "frame"),
    ):
        reader = Reader(STANDARD, "nav_msgs/msg/Odometry", pick, frame, child)
        assert REASONS[reader.read_many(data, [0], [len(data)]).status[0, 0]] == result


def test_axes_there_and_back_through_a_message() -> None:
    """NED and FRD in the machine, ENU and FLU in the message, and back to the same values."""
    rng = np.random.default_rng(4)
    q, p, v = rng.normal(size=4), rng.normal(size=3), rng.normal(size=3)
    q /= np.linalg.norm(q)
    memory = np.concatenate([q, p, v])
    name = "nav_msgs/msg/Odometry"
    fields = [
        ("pose.pose.orientation", 4, "ned/frd"),
        ("pose.pose.position", 3, "ned"),
        ("twist.twist.linear", 3, "frd"),
    ]
    offsets = np.cumsum([0, 4, 3]) * 8
    composer = Composer(
        STANDARD, name, [Source(f, "f64", n, int(o), axes) for (f, n, axes), o in zip(fields, offsets, strict=True)]
    )
    data = composer.compose([memory.ctypes.data], 0)
    assert data is not None
    message = deserialize_message(data, message_class(name))
    position, linear = message.pose.pose.position, message.twist.twist.linear
    assert [position.x, position.y, position.z] == [p[1], p[0], -p[2]]
    assert [linear.x, linear.y, linear.z] == [v[0], -v[1], -v[2]]
    reader = Reader(STANDARD, name, [Pick(f, (f,), "f64", n, axes=axes) for f, n, axes in fields])
    samples = reader.read_many(data, [0], [len(data)]).values[0]
    assert samples["pose.pose.position"].tolist() == p.tolist()
    assert samples["twist.twist.linear"].tolist() == v.tolist()
    assert np.abs(samples["pose.pose.orientation"] - q).max() < 3e-16
