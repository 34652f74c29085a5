# SPDX-License-Identifier: Apache-2.0
"""A user's package whose machine has structs: rosidl builds their messages, and reads and writes the runtime's bytes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TRACK = """
class Outputs:
    targets: "Target[2, 2]"
    pose: "Pose"
    alive: "bool"


def execute() -> None:
    pass
"""
CONFIG = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {
        "Pose": {"valid": "bool", "position": "f64[3] m", "attitude": "f32[4]", "level": "i32"},
        "Target": {"id": "u32", "pose": "Pose", "alive": "bool", "weight": "f64 kg"},
    },
    "algorithms": {"track": {"source": "track.py"}},
    "instances": {"track": {"algorithm": "track"}},
    "states": {"RUN": {"schedule": {"track": 100}}},
}
CMAKE = """cmake_minimum_required(VERSION 3.22)
project(rover C)
find_package(ament_cmake REQUIRED)
find_package(fcsl_compiler REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)
fcsl_add_machine(rover_machines rover.json)
fcsl_generate_interfaces(rover.json)
ament_package()
"""
MANIFEST = """<package format="3">
  <name>rover</name><version>0.1.0</version><description>A test.</description>
  <maintainer email="a@b.invalid">a</maintainer><license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend><buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>std_msgs</depend><member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""
#: Runs in a process of its own, whose environment has the new package.
CHECK = """
import dataclasses, random
from rclpy.serialization import deserialize_message, serialize_message
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.interfaces import instance_class
from fcsl_bridge.machine_index import find_machine
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from simclient import AlgTwin
from simclient.cdr import fixed_layout

library, name = find_machine("rover/rover")
with AlgTwin.from_library(library, name) as twin:
    track = twin.instances()[0]
    kind = instance_class(track)
    store = get_typestore(Stores.ROS2_JAZZY)
    types = get_types_from_msg(track.message_text, track.message_type)
    store.register({n: f for n, f in types.items() if n not in store.fielddefs})
    layout = fixed_layout(store.fielddefs, track.message_type)
    assert len(layout.leaves) == 3 + 4 * 7 + 4 + 2 and layout.size == len(twin._run.message(0))
    for seed in range(20):
        r = random.Random(seed)
        pose = lambda: {"valid": r.random() < 0.5, "position": [r.gauss(0, 1e3) for _ in range(3)],
                        "attitude": [r.randrange(-8, 8) / 8 for _ in range(4)], "level": r.randrange(-9, 9)}
        target = lambda: {"id": r.randrange(2**32), "pose": pose(), "alive": r.random() < 0.5, "weight": r.random()}
        twin.set("track.outputs.targets", [[target(), target()], [target(), target()]])
        twin.set("track.outputs.pose", pose())
        twin.set("track.outputs.alive", r.random() < 0.5)
        twin.tick()
        data = twin._run.message(0)
        message = deserialize_message(data, kind)
        assert message.tick == seed and message.header.stamp.nanosec == seed * 10_000_000
        assert [t.id for t in message.targets] == [t["id"] for row in twin.get_value("track.outputs.targets") for t in row]
        for got, path in ((message.pose, "pose"), (message.targets[3].pose, "targets[1][1].pose")):
            want = twin.get_value(f"track.outputs.{path}")
            assert (got.valid, list(got.position), list(got.attitude), got.level) == tuple(want.values())
        assert message.targets[2].weight == twin.get_value("track.outputs.targets[1][0].weight")
        assert message.alive == twin.get_value("track.outputs.alive")
        theirs = serialize_message(message)
        assert len(theirs) == len(data)  # what they leave in the padding is whatever was there
        for leaf in layout.leaves.values():
            at = slice(leaf.offset, leaf.offset + leaf.dtype.itemsize)
            assert theirs[at] == data[at], leaf
    changed = dataclasses.replace(track, message_text=track.message_text.replace("int32 level", "int64 level"))
    try:
        instance_class(changed)
    except BridgeError as error:
        assert "message rover/msg/RoverPose of package `rover` is not the one" in str(error), error
    else:
        raise AssertionError("a struct of another build was accepted")
print("same bytes")
"""


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package built and installed as colcon would."""
    folder = tmp_path_factory.mktemp("rover")
    for name, text in (
        ("track.py", TRACK),
        ("rover.json", json.dumps(CONFIG)),
        ("CMakeLists.txt", CMAKE),
        ("package.xml", MANIFEST),
    ):
        (folder / name).write_text(text)
    for arguments in (
        ["-S", folder, "-B", folder / "build", f"-DCMAKE_INSTALL_PREFIX={folder / 'install'}", "-DBUILD_TESTING=OFF"],
        ["--build", folder / "build", "--target", "install", "--parallel", "2"],
    ):
        done = subprocess.run(["cmake", *map(str, arguments)], capture_output=True, text=True, timeout=500)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return folder / "install"


def test_rosidl_reads_and_writes_the_same_bytes(prefix: Path) -> None:
    python = next(prefix.glob("l*/python3*/*-packages"))
    env = os.environ | {
        "AMENT_PREFIX_PATH": f"{prefix}:{os.environ['AMENT_PREFIX_PATH']}",
        "PYTHONPATH": f"{python}:{os.environ.get('PYTHONPATH', '')}",
        "LD_LIBRARY_PATH": f"{prefix / 'lib'}:{os.environ.get('LD_LIBRARY_PATH', '')}",
    }
    done = subprocess.run([sys.executable, "-c", CHECK], capture_output=True, text=True, env=env, timeout=120)
    assert (done.returncode, done.stdout) == (0, "same bytes\n"), done.stderr


def test_every_struct_is_a_message_file(prefix: Path) -> None:
    files = {p.name: p.read_text() for p in (prefix / "share/rover/msg").glob("*.msg")}
    assert set(files) == {"RoverTrack.msg", "RoverTarget.msg", "RoverPose.msg"}
    assert "RoverTarget[4] targets # Target[2, 2], row-major\nRoverPose pose\n" in files["RoverTrack.msg"]
    assert files["RoverTarget.msg"] == (
        "# Struct Target of machine rover.\nuint32 id\nRoverPose pose\nbool alive\nfloat64 weight # [kg]\n"
    )
