# SPDX-License-Identifier: Apache-2.0
"""Every installed message is mapped, or refused by a rule; those that are mapped are read and made as rclpy does."""

from __future__ import annotations

import ctypes
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fcsl_bridge.topics.interfaces import message_class
from fcsl_compiler.base.packages import package_share
from fcsl_compiler.ros.composer import Source
from fcsl_compiler.ros.definition_text import read_definition
from fcsl_compiler.ros.interfaces import InterfaceError, find_interfaces
from fcsl_compiler.ros.reader import Pick
from fcsl_compiler.ros.standard_messages import SIZES, Definitions, short_name
from fcsl_compiler.ros.type_hash import type_hash
from simclient.ros.composer import Composer
from simclient.ros.reader import Reader

PACKAGES = ("actionlib_msgs", "diagnostic_msgs", "geometry_msgs", "nav_msgs", "rcl_interfaces", "sensor_msgs")
PACKAGES += ("shape_msgs", "std_msgs", "stereo_msgs", "trajectory_msgs", "visualization_msgs")
NAMES = [f"{p}/msg/{file.stem}" for p in PACKAGES for file in sorted((package_share(p) / "msg").glob("*.msg"))]
#: Those that are refused: an unbounded list of bytes is bulk data.
BULK = {
    "nav_msgs": ("OccupancyGrid",),
    "rcl_interfaces": ("Parameter", "ParameterEvent", "ParameterValue"),
    "sensor_msgs": ("CompressedImage", "Image", "PointCloud2"),
    "std_msgs": ("ByteMultiArray",),
    "stereo_msgs": ("DisparityImage",),
    "visualization_msgs": (
        *("InteractiveMarker", "InteractiveMarkerControl", "InteractiveMarkerInit"),
        *("InteractiveMarkerUpdate", "Marker", "MarkerArray", "MeshFile"),
    ),
}
BULKY = {f"{package}/msg/{name}" for package, names in BULK.items() for name in names}
#: And what has no fields.
EMPTY = {"rcl_interfaces/msg/ParameterType", "std_msgs/msg/Empty"}
REFUSED = BULKY | EMPTY
MAPPED = [name for name in NAMES if name not in REFUSED]
STORE = get_typestore(Stores.ROS2_JAZZY)
NOWHERE = Path("nowhere.json")
for _name in MAPPED:  # what is newer than rosbags knows
    if _name not in STORE.fielddefs:
        _package, _, _bare = _name.split("/")
        STORE.register(get_types_from_msg((package_share(_package) / "msg" / f"{_bare}.msg").read_text(), _name))
WIDEST = {"bool": "bool", "float32": "f32", "float64": "f64"}
CODES = {"bool": "?", "f32": "f", "f64": "d", "i32": "i", "i64": "q", "u32": "I", "u64": "Q"}


def definition(name: str) -> Definitions:
    return find_interfaces(short_name(name), NOWHERE).members


def test_refused_by_a_rule() -> None:
    found = {}
    for name in NAMES:
        try:
            definition(name)
        except InterfaceError as error:
            found[name] = error.args[0]
    assert {name for name, text in found.items() if "an unbounded list of bytes: bulk data" in text} == BULKY
    assert {name for name, text in found.items() if "has no fields" in text} == EMPTY
    assert set(found) == REFUSED


def test_hashes_are_those_of_rosidl() -> None:
    for name in MAPPED:
        package, _, bare = name.split("/")
        described = json.loads((package_share(package) / "msg" / f"{bare}.json").read_text())
        assert type_hash(definition(name), name) == described["type_hashes"][0]["hash_string"], name


def test_constants() -> None:
    for name in MAPPED:
        package, _, bare = name.split("/")
        class_ = message_class(name)
        constants = find_interfaces(short_name(name), NOWHERE).constants.get(name, {})
        text = (package_share(package) / "msg" / f"{bare}.msg").read_text()
        assert set(constants) == set(read_definition(name, text).constants), name
        for constant, number in constants.items():
            held = getattr(class_, constant)
            assert number == (held[0] if isinstance(held, bytes) else held), (name, constant)


class Values:
    """The numbers and strings of a message that is filled at random, as picks and as sources in memory. A list of
    numbers has room for `spare` more."""

    def __init__(self, members: Definitions, seed: int):
        self.rng, self.members = np.random.default_rng(seed), members
        self.picks: list[Pick] = []
        self.sources: list[Source] = []
        self.wanted: list[list[Any]] = []
        self.memory = bytearray()

    def _number(self, type_: str) -> Any:
        if type_ == "bool":
            return bool(self.rng.integers(2))
        if type_.startswith("float"):
            return float(np.float32(self.rng.normal() * 10.0 ** self.rng.integers(-20, 20)))
        bits = 8 * SIZES[type_]
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if type_.startswith("int") else (0, 2**bits - 1)
        return int(self.rng.choice([low, high, 1], p=[0.3, 0.3, 0.4]).astype(object)) if bits < 64 else high

    def _add(self, path: str, scalar: str, values: list[Any], choices: tuple[str, ...] = ()) -> None:
        code = CODES[scalar]
        self.memory += bytes(-len(self.memory) % struct.calcsize(code))
        name = f"v{len(self.picks)}"
        self.picks.append(Pick(name, (path,), scalar, len(values), choices=choices))
        self.sources.append(Source(path, scalar, len(values), len(self.memory), name=name, choices=choices))
        self.memory += struct.pack(f"={len(values)}{code}", *values)
        self.wanted.append(values)

    def fill(self, message: Any, name: str, prefix: str = "") -> None:
        for member in self.members[name]:
            path = prefix + member.name
            if path == "header":
                message.header.frame_id = "imu_link"
                message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
            elif member.type in SIZES:
                self._numbers(message, member, path)
            elif member.type == "string":
                text = "".join(self.rng.choice(list("abcd_/é"), self.rng.integers(0, 9)))
                setattr(message, member.name, [""] * member.count if member.is_array else text)
                if not member.is_array:
                    self._add(path, "i32", [1], ("another", text))
            else:
                count = int(self.rng.integers(0, (member.bound or 2) + 1)) if member.sequence else member.count
                ones = [message_class(member.type)() for _ in range(count if member.is_array else 1)]
                for i, one in enumerate(ones):
                    self.fill(one, member.type, f"{path}[{i}]." if member.is_array else f"{path}.")
                setattr(message, member.name, ones if member.is_array else ones[0])

    def _numbers(self, message: Any, member: Any, path: str) -> None:
        most = member.bound or 4
        count = int(self.rng.integers(0, most + 1)) if member.sequence else max(1, member.count)
        values = [self._number(member.type) for _ in range(count)]
        octets = [bytes([v]) for v in values] if member.type == "byte" else values
        setattr(message, member.name, octets if member.is_array else octets[0])
        scalar = WIDEST.get(member.type) or ("u64" if not member.type.startswith("int") else "i64")
        if not member.sequence:
            self._add(path, scalar, values)
            return
        self._add(path, scalar, values + [type(self._number(member.type))(0)] * (most - count))
        self._add(f"{path}.count", "u32", [count])


def random_message(name: str, seed: int) -> tuple[Any, Values]:
    message, values = message_class(name)(), Values(definition(name), seed)
    values.fill(message, name)
    return message, values


@pytest.mark.parametrize("package", PACKAGES)
def test_as_rclpy_reads_and_makes_them(package: str) -> None:
    for name in (
        n for n in MAPPED if n.startswith(package + "/") and not n.endswith(("JointState", "NavSatFix", "Imu"))
    ):
        for seed in range(4):
            message, values = random_message(name, seed)
            data = serialize_message(message)
            samples = Reader(values.members, name, values.picks).read_many(data, [0], [len(data)])
            assert not samples.status.any(), name
            for pick, wanted in zip(values.picks, values.wanted, strict=True):
                got = np.atleast_1d(samples.values[pick.name][0]).tolist()
                assert got == wanted, (name, pick)
            frames = {"frame": "imu_link"} if hasattr(message, "header") else {}
            memory = ctypes.create_string_buffer(bytes(values.memory), max(1, len(values.memory)))
            composer = Composer(values.members, name, values.sources, **frames)
            made = composer.compose([ctypes.addressof(memory)], 12_000_000_034)
            assert made is not None and deserialize_message(made, message_class(name)) == message, name
            # rclpy's bytes, but for its padding, which is not zero, and bytes behind its end.
            again = bytes(STORE.serialize_cdr(STORE.deserialize_cdr(data[: len(made)], name), name))
            assert made == again, name
