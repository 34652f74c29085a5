# SPDX-License-Identifier: Apache-2.0
"""Mapped poses on /tf, read back as the replay of bags reads transforms. The nodes need tf2_msgs, which PyPI's wheels lack."""

from __future__ import annotations

import json
import math
import signal
import subprocess
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bridge_harness import MACHINE, SIM, Domain
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from fcsl_bridge.errors import BridgeError
from fcsl_bridge.topics import qos, tf
from simclient.bag import Bag
from simclient.replay.frames import Chain, Frames
from simclient.ros.composer import Source

NEEDS_TF2 = pytest.mark.skipif(find_spec("tf2_msgs") is None, reason="tf2_msgs is not installed")
#: What tf2's listener asks for.
LISTENER = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE)
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"


def chain(folder: Path, messages: list[tuple[int, bytes]], parent: str, child: str, static: bytes = b"") -> Chain:
    """The transforms from one frame to another, of a bag with these messages on /tf, and that one on /tf_static."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/tf", tf.MESSAGE, typestore=store)
        for time_ns, data in messages:
            writer.write(connection, time_ns, data)
        if static:
            writer.write(writer.add_connection("/tf_static", tf.MESSAGE, typestore=store), 1, static)
    return Frames(Bag(folder), True).between(parent, child)


def posed(name: str, kind: str, frame: str, child: str, *sources: Source) -> tf.Posed:
    return tf.Posed(name, kind, frame, child, sources)


def test_a_pose_becomes_the_transform_that_it_is(tmp_path: Path) -> None:
    """In the machine's axes, with a twist that is not of the pose; a height alone is a transform without rotation."""
    walk = np.random.default_rng(4).normal(size=(5, 10))
    walk[:, :4] /= np.linalg.norm(walk[:, :4], axis=1, keepdims=True)
    odom = posed(
        *("odom", ODOMETRY, "odom", "base_link"),
        Source("pose.pose.orientation", "f64", 4, 0, "ned/frd"),
        Source("pose.pose.position", "f64", 3, 32, "ned"),
        Source("twist.twist.linear", "f64", 3, 56, "frd"),
    )
    height = posed("height", POSE, "base_link", "", Source("pose.position.z", "f64", 1, 48))
    composers = tf.broadcasts(["odom", "height=mast"], [odom, height])
    messages = []
    for i, row in enumerate(walk):
        for composer in composers.values():
            data = composer.compose([row.ctypes.data], 10**9 * (1 + i))
            assert data is not None
            messages.append((10**9 * (1 + i), data))
    found = chain(tmp_path / "bag", messages, "odom", "base_link")
    n, e, d = walk[:, 4:7].T
    assert found.times_ns.tolist() == [10**9 * (1 + i) for i in range(5)]
    assert np.array_equal(found.poses.position, np.stack([e, n, -d], axis=1))
    mast = Frames(Bag(tmp_path / "bag"), True).between("base_link", "mast")
    assert np.array_equal(mast.poses.position, np.stack([0 * d, 0 * d, d], axis=1))
    assert np.array_equal(mast.poses.rotation, np.tile([0.0, 0.0, 0.0, 1.0], (5, 1)))
    assert not any(link.refused for link in found.links)


POSITION = Source("pose.pose.position", "f64", 3, 0)
TOPICS = [
    posed("odom", ODOMETRY, "odom", "base_link", POSITION),
    posed("twice", ODOMETRY, "map", "base_link", POSITION),
    posed("speed", ODOMETRY, "odom", "body", Source("twist.twist.linear", "f64", 3, 0)),
    posed("pose", POSE, "map", "", Source("pose.position", "f64", 3, 0)),
    posed("nowhere", ODOMETRY, "", "base_link", POSITION),
    posed("slash", ODOMETRY, "/map", "base_link", POSITION),
    posed("imu", "sensor_msgs/msg/Imu", "imu", "", Source("angular_velocity", "f64", 3, 0)),
]


@pytest.mark.parametrize(
    ("chosen", "reason"),
    [
        (["odm"], "this node publishes no pose on `odm`; did you mean `odom`?"),
        (["imu"], "`imu` is a sensor_msgs/Imu; poses are in geometry_msgs/PoseStamped, "),
        (["pose"], "`pose` names no child frame; write pose=base_link"),
        (["pose=map"], "`pose=map` places `map` in itself"),
        (["nowhere"], "`nowhere` has no frame; write `frame` into its `ros` block"),
        (["slash"], "frame `/map` of `slash`: tf2 takes none with a leading slash"),
        (["speed"], "nothing fills the pose of `speed`"),
        (["odom", "twice"], "`odom` and `twice` both place `base_link`"),
    ],
)
def test_what_cannot_be_broadcast_is_told(chosen: list[str], reason: str) -> None:
    with pytest.raises(BridgeError) as error:
        tf.broadcasts(chosen, TOPICS)
    assert str(error.value).startswith("parameter `tf`: ") and reason in str(error.value)


def tf_message() -> Any:
    from tf2_msgs.msg import TFMessage

    return TFMessage


@NEEDS_TF2
def test_truth_on_tf(domain: Domain, tmp_path: Path) -> None:
    """In lock-step: each tick's odometry of the plant is a transform, with the same stamp and the same numbers."""
    listener = domain.listener()
    listener.subscribe(Odometry, "/odom", qos.STREAM)
    listener.subscribe(tf_message(), "/tf", LISTENER)
    domain.start("controller_node", machine=MACHINE, timeout_s=60.0)
    sim = domain.start("sim_node", sim=SIM, tf="[odom]", duration="1.0", speed=2.0, timeout_s=60.0)
    odom, transforms = listener.received["/odom"], listener.received["/tf"]
    listener.until(lambda: sim.process.poll() is not None)
    assert sim.finish() == 0, sim.err
    found = chain(tmp_path / "bag", list(enumerate(transforms, start=1)), "map", "base_link")
    heights = {}
    for data in odom:
        message = deserialize_message(data, Odometry)
        stamp = message.header.stamp
        heights[stamp.sec * 10**9 + stamp.nanosec] = message.pose.pose.position.z
    common = [i for i, time_ns in enumerate(found.times_ns.tolist()) if time_ns in heights]
    assert len(common) > 20
    for i in common:
        assert found.poses.position[i].tolist() == [0.0, 0.0, heights[int(found.times_ns[i])]]


WALKER = """
class Walker:
    outputs = {"position": "f64[3] m", "attitude": "f64[4]"}
    inputs = {"t": "i64"}

    def execute(self):
        self.position[0] += 0.5
        self.attitude[0] = 1.0
"""


def walker(folder: Path) -> Path:
    """The library of a machine whose pose is mapped, and that has frames."""
    ros = {"type": "geometry_msgs/PoseStamped", "topic": "pose", "frame": "odom"}
    fields = {"position": "pose.position", "attitude": "pose.orientation"}
    channels = [
        {
            "name": name,
            "id": i,
            "field": f"walker.outputs.{name}",
            "direction": "actuator",
            "ros": {**ros, "field": field},
        }
        for i, (name, field) in enumerate(fields.items())
    ]
    machine = {
        "tick_hz": 50,
        "initial_state": "GO",
        "publish": [],
        "algorithms": {"Walker": {"source": "walker.py"}},
        "instances": {"walker": {"algorithm": "Walker"}},
        "connections": [],
        "states": {"GO": {"schedule": {"walker": 50}}},
        "transitions": [],
        "channels": channels,
        "views": {
            "panels": [{"title": "position", "values": ["walker.outputs.position"]}],
            "frames": [
                {"frame": "mast", "parent": "base_link", "position": [0, 0, 2], "rpy": [0, 0, math.pi / 2]},
                {"frame": "camera", "parent": "mast", "position": [1, 0, 0], "rotation": [0, 1, 0, 0]},
            ],
        },
    }
    (folder / "walker.py").write_text(WALKER)
    (folder / "walker.json").write_text(json.dumps(machine))
    build = ["fcslc", "build", str(folder / "walker.json"), "-o", str(folder / "out")]
    subprocess.run(build, check=True, capture_output=True)
    return folder / "out" / "libwalker.so"


@NEEDS_TF2
def test_a_channel_and_static_frames_on_tf(domain: Domain, tmp_path: Path) -> None:
    """Composed by the tree of frames, as tf2 does it: the camera is 1 m to the left of the mast."""
    listener = domain.listener()
    listener.subscribe(tf_message(), "/tf", LISTENER)
    node = domain.start("controller_node", machine=walker(tmp_path), mode="realtime", tf="[pose=base_link]")
    listener.until(lambda: len(listener.received["/tf"]) >= 10)
    listener.subscribe(tf_message(), "/tf_static", qos.LATCHED)
    listener.until(lambda: bool(listener.received["/tf_static"]))
    node.signal(signal.SIGINT)
    assert node.finish() == 0, node.err
    (static,) = listener.received["/tf_static"]
    moving = list(enumerate(listener.received["/tf"], start=1))
    found = chain(tmp_path / "bag", moving, "odom", "camera", static)
    assert np.allclose(np.diff(found.poses.position[:10, 0]), 0.5, rtol=0, atol=1e-12)
    assert np.allclose(found.poses.position[:10, 1:], [1.0, 2.0], rtol=0, atol=1e-12)
    half = math.sqrt(0.5)
    assert np.allclose(np.abs(found.poses.rotation[:10]), [half, half, 0.0, 0.0], rtol=0, atol=1e-12)


@pytest.mark.skipif(find_spec("tf2_msgs") is not None, reason="tf2_msgs is installed")
def test_without_tf2_msgs(domain: Domain, tmp_path: Path) -> None:
    """The machine runs without its frames; a pose that was asked for is an error."""
    library = walker(tmp_path)
    node = domain.start("controller_node", machine=library, mode="realtime")
    node.wait_for("the machine's frames are not on /tf_static: ")
    node.signal(signal.SIGINT)
    assert node.finish() == 0, node.err
    refused = domain.start("controller_node", machine=library, mode="realtime", tf="[pose=base_link]")
    assert refused.finish() == 1 and "package `tf2_msgs` has no ROS 2 messages" in refused.err
