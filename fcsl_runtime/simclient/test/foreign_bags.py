# SPDX-License-Identifier: Apache-2.0
"""Writes the same messages as a bag of any format, with the writers of `rosbags`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
MS = 1_000_000

#: Topic to (log time in ns, message of ROS 2) in order.
Content = Mapping[str, Sequence[tuple[int, Any]]]

#: Name of a format to storage and compression.
ROS2_FORMATS = {
    "mcap": (StoragePlugin.MCAP, None),
    "mcap-chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "mcap-file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap-message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "sqlite3": (StoragePlugin.SQLITE3, None),
    "sqlite3-file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite3-message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
}
ROS1_FORMATS = {
    "ros1": None,
    "ros1-bz2": Ros1Writer.CompressionFormat.BZ2,
    "ros1-lz4": Ros1Writer.CompressionFormat.LZ4,
}
FORMATS = (*ROS2_FORMATS, *ROS1_FORMATS)


def make(kind: str, **fields: Any) -> Any:
    """A message of ROS 2 Jazzy; fields that are not given are zero, empty, or zero messages."""
    values = {}
    for name, (node, detail) in STORE.fielddefs[kind][1]:
        values[name] = fields.pop(name) if name in fields else _zero(node, detail)
    assert not fields, fields
    return STORE.types[kind](**values)


def _zero(node: Any, detail: Any) -> Any:
    if node.name == "NAME":
        return make(detail)
    if node.name == "BASE":
        return "" if detail[0] == "string" else False if detail[0] == "bool" else 0
    (inner, inner_detail), count = detail
    if node.name == "SEQUENCE":
        count = 0
    if inner.name == "NAME" or inner_detail[0] == "string":
        return [_zero(inner, inner_detail) for _ in range(count)]
    return np.zeros(count, np.dtype(inner_detail[0]))


def header(time_ns: int, frame: str = "imu_link") -> Any:
    stamp = make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def quaternion(w: float, x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/msg/Quaternion", x=float(x), y=float(y), z=float(z), w=float(w))


def imu(time_ns: int, gyro: Sequence[float] = (0, 0, 0), attitude: Sequence[float] = (0.9, 0.1, 0.2, 0.3)) -> Any:
    return make(
        "sensor_msgs/msg/Imu",
        header=header(time_ns),
        orientation=quaternion(*attitude),
        orientation_covariance=np.arange(9.0),
        angular_velocity=vector(*gyro),
        linear_acceleration=vector(0, 0, 9.81),
    )


def number(value: float) -> Any:
    return make("std_msgs/msg/Float64", data=float(value))


def in_order(content: Content) -> list[tuple[int, str, Any]]:
    """Messages of all topics as a recorder takes them: by time, topics of one time in order."""
    every = [(time_ns, topic, message) for topic, messages in content.items() for time_ns, message in messages]
    return sorted(every, key=lambda entry: entry[0])


def write(path: Path, content: Content, form: str = "mcap", ordered: bool = True) -> Path:
    """Writes a bag in one of FORMATS and returns what to open; `ordered` False: topic by topic."""
    messages = in_order(content) if ordered else [(t, topic, m) for topic in content for t, m in content[topic]]
    return write_as_given(path, messages, form)


def write_as_given(path: Path, messages: Sequence[tuple[int, str, Any]], form: str) -> Path:
    """Like `write`, with the messages in this order: (log time in ns, topic, message)."""
    if form in ROS1_FORMATS:
        return _write_ros1(path.with_suffix(".bag"), messages, ROS1_FORMATS[form])
    plugin, mode = ROS2_FORMATS[form]
    writer = Writer(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[tuple[str, str], Any] = {}
        for time_ns, topic, message in messages:
            kind = message.__msgtype__
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic, kind], time_ns, STORE.serialize_cdr(message, kind))
    return path


def write_mcap(
    path: Path,
    messages: Sequence[tuple[int, str, Any]],
    compression: CompressionType = CompressionType.NONE,
    chunk_bytes: int = 2000,
) -> Path:
    """A single .mcap file by the `mcap` package, in chunks of this size (0: without chunks). Raw bytes may stand for a
    message: (bytes, type name, text of the definition)."""
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk_bytes or 1, compression=compression, use_chunking=chunk_bytes > 0)
        writer.start(profile="ros2")
        numbers: dict[tuple[str, str, str], int] = {}
        for time_ns, topic, message in messages:
            data, kind, text = message if isinstance(message, tuple) else encoded(message)
            if (topic, kind, text) not in numbers:
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                numbers[topic, kind, text] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(numbers[topic, kind, text], time_ns, data, time_ns)
        writer.finish()
    return path


def encoded(message: Any) -> tuple[bytes, str, str]:
    """(CDR, type name, text of the definition)."""
    kind = message.__msgtype__
    return bytes(STORE.serialize_cdr(message, kind)), kind, STORE.generate_msgdef(kind, ros_version=2)[0]


def _write_ros1(path: Path, messages: Sequence[tuple[int, str, Any]], compression: Any) -> Path:
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections: dict[str, Any] = {}
        for sequence, (time_ns, topic, message) in enumerate(messages):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], time_ns, ROS1.serialize_ros1(_as_ros1(message, sequence), kind))
    return path


def _as_ros1(message: Any, sequence: int) -> Any:
    """The same fields in ROS 1's classes; headers get a sequence number."""
    if not hasattr(message, "__msgtype__"):
        return [_as_ros1(item, sequence) for item in message] if isinstance(message, list) else message
    names = [name for name in message.__dataclass_fields__ if name != "__msgtype__"]
    fields = {name: _as_ros1(getattr(message, name), sequence) for name in names}
    if message.__msgtype__ == "std_msgs/msg/Header":
        fields["seq"] = sequence
    return ROS1.types[message.__msgtype__](**fields)


def split(path: Path, parts: Mapping[str, Content], form: str = "mcap") -> Path:
    """A bag of several files, each with its part of the messages, listed in metadata.yaml in the order given."""
    path.mkdir()
    names = []
    for name, content in parts.items():
        part = write(path.parent / f"{path.name}-{name}", content, form)
        file = next(file for file in part.iterdir() if file.name != "metadata.yaml")
        target = path / f"{name}{''.join(file.suffixes)}"
        file.rename(target)
        names.append(target.name)
    (path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": {"relative_file_paths": names}}))
    return path
