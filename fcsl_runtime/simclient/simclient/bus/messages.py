# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages of channels: a definition for each, and values of the bus as CDR.

Header (with an empty frame), tick and value: the value begins at byte 24, a multiple of 8, so it lies in a message as it
does on the bus.
"""

from __future__ import annotations

import math
import re
import struct

from .machine import BusChannel, BusMachine

_TYPES = {
    "bool": "bool",
    "i32": "int32",
    "i64": "int64",
    "u32": "uint32",
    "u64": "uint64",
    "f32": "float32",
    "f64": "float64",
}
_DEFINITION = """\
{about}std_msgs/Header header
uint64 tick
{type} value{unit}
"""
_LINE = "=" * 80
_NEEDED = f"""\
{_LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
#: Topics of a machine that say what reproduces it: behind `/[NAMESPACE/]MACHINE/`, with type and definition.
DESCRIPTOR, CHECKPOINT, WRITES, LACKS = "record/descriptor", "record/checkpoint", "record/writes", "record/lacks"
_STRING = "std_msgs/msg/String", "string data\n"
RECORD_TOPICS = {
    DESCRIPTOR: _STRING,
    CHECKPOINT: (
        "fcsl_msgs/msg/Checkpoint",
        """\
std_msgs/Header header
uint64 tick
string machine
string source_hash
string layout_hash
string build_hash
uint8[] data
"""
        + _NEEDED,
    ),
    WRITES: (
        "fcsl_msgs/msg/HostWrite",
        """\
uint8 SET=0
uint8 SET_STATE=1
uint8 RESTORE=2
uint8 CHANNEL=3
uint8 OVERRUN=4
uint8 ATTACH=5
uint8 IMPURE=6
uint8 FAULT=7
uint8 HEALTH=8
uint8 EVENTS=9
uint8 LOST=10
std_msgs/Header header
uint64 tick
uint8 kind
string path
uint32 element
uint32 age_ticks
int64 stamp_ns
uint8[] data
"""
        + _NEEDED,
    ),
    LACKS: _STRING,
}
#: Encapsulation (little-endian), stamp, length and zero of the frame, padding, tick.
_HEAD = struct.Struct("<4siIIB3xQ")


def type_names(machine: BusMachine) -> dict[str, str]:
    """Type of each channel's message: `imu.gyro` of machine `rover` is rover_bus/msg/ImuGyro."""
    package = re.sub(r"_+", "_", re.sub(r"[^a-z0-9]", "_", machine.name.lower())).strip("_")
    found: dict[str, str] = {}
    for channel in machine.channels:
        words = re.split(r"[^A-Za-z0-9]+", channel.name)
        name = "".join(word[:1].upper() + word[1:] for word in words) or "Channel"
        name = f"{package}_bus/msg/{name if name[0].isalpha() else 'Channel' + name}"
        found[channel.name] = name if name not in found.values() else f"{name}Id{channel.index}"
    return found


def definition_of(channel: BusChannel) -> str:
    """The text of the channel's message, with those that it needs."""
    if channel.is_blob:
        kind = f"uint8[<={channel.shape[0]}]"
    else:
        kind = _TYPES[channel.type] + (f"[{math.prod(channel.shape)}]" if channel.shape else "")
    about = f"# {_one_line(channel.doc)}\n" if channel.doc else ""
    unit = f"  # {_one_line(channel.unit)}" if channel.unit else ""
    return _DEFINITION.format(about=about, type=kind, unit=unit) + _NEEDED


def message_of(channel: BusChannel, tick: int, time_ns: int, value: bytes) -> bytes:
    head = _HEAD.pack(b"\0\1\0\0", time_ns // 1_000_000_000 % (1 << 31), time_ns % 1_000_000_000, 1, 0, tick)
    return head + (struct.pack("<I", len(value)) if channel.is_blob else b"") + value


def string_of(text: str) -> bytes:
    """std_msgs/String as CDR."""
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(data)) + data


def _one_line(text: str) -> str:
    return " ".join(text.split())
