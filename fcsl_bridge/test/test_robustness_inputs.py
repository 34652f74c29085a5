# SPDX-License-Identifier: Apache-2.0
"""A free-running machine with other nodes that publish invalid messages, stall, vanish, or publish the same actuators."""

from __future__ import annotations

import json
import random
import signal
import struct
import threading
import time
from pathlib import Path

import pytest
import rig
from bridge_harness import Domain
from controller_client import ControllerClient, figures
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, String

from fcsl_bridge.topics import qos
from simclient.replay import replay

#: CDR of an Imu: encapsulation, stamp, frame_id "imu_link" with its NUL.
ENCAPSULATION, FRAME_AT = b"\x00\x01\x00\x00", 12
BIASED = 0.25  # the rig's torque without a rate


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"))


class Robot:
    """A free-running rig, and a test node on its topics."""

    def __init__(self, domain: Domain, library: Path):
        self.bag, self.library = domain.folder / "bag", library
        self.listener = domain.listener()
        self.imu = self.listener.node.create_publisher(Imu, "/imu/data", qos.STREAM)
        self.listener.subscribe(Float64, "/motor/torque", qos.COMMAND)
        self.torques = self.listener.received["/motor/torque"]
        self.process = domain.start("controller_node", machine=library, mode="realtime", record=self.bag)
        self.client = ControllerClient(self.listener)
        self.listener.until(lambda: self.imu.get_subscription_count() == 1 and bool(self.torques))

    def sense(self, rate: float) -> None:
        self.imu.publish(imu(rate, self.listener.node.get_clock().now().nanoseconds))

    def torque(self) -> float:
        return float(deserialize_message(self.torques[-1], Float64).data)

    def obeys(self, rate: float) -> None:
        """Asserts that the command follows a new sample."""

        def follows() -> bool:
            self.sense(rate)
            return self.torque() == BIASED + rate

        self.listener.until(follows)

    def status(self) -> DiagnosticStatus:
        return self.client.diagnosed()[0]["rig"]

    def figure(self, name: str) -> int:
        return int(figures(self.status()).get(name, 0))

    def finish(self) -> None:
        """Shuts down cleanly; the record replays."""
        self.process.signal(signal.SIGINT)
        assert self.process.finish() == 0
        assert replay(self.bag, library=str(self.library)).identical


def imu(rate: float, stamp_ns: int) -> bytes:
    message = Imu()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.header.frame_id = "imu_link"
    message.angular_velocity.z = rate
    return bytes(serialize_message(message))


# ---- hostile publishers ------------------------------------------------------------------------------------------------------


def hostile(noise: random.Random, stamp_ns: int) -> list[bytes]:
    """Bytes of a broken or malicious node, including complete messages with invalid values."""
    good = imu(1.0, stamp_ns)

    def patched(at: int, data: bytes) -> bytes:
        return good[:at] + data + good[at + len(data) :]

    return [
        ENCAPSULATION,
        b"\x00\x00" + good[2:],  # marked as big-endian
        *(good[:size] for size in range(4, len(good) - 8, 8)),
        patched(FRAME_AT, struct.pack("<I", 0xFFFFFFFF)),
        patched(FRAME_AT, struct.pack("<I", 0x7FFFFFFF)),
        patched(FRAME_AT, struct.pack("<I", 0)),
        patched(FRAME_AT + 4, b"imu_link!"),  # no NUL
        patched(4, struct.pack("<iI", -5, 2_000_000_000)),  # invalid stamp
        imu(float("nan"), stamp_ns),
        good + bytes(1 << 20),
        *(ENCAPSULATION + noise.randbytes(noise.randrange(600)) for _ in range(50)),
    ]


def test_whatever_comes_as_an_imu_is_refused_and_counted(domain: Domain, library: Path) -> None:
    robot = Robot(domain, library)
    robot.obeys(1.0)
    least = {"encoding": 1, "truncated": 20, "malformed": 1, "nan": 1, "stamp": 1}

    def refused() -> bool:
        """Best-effort messages get lost on a busy computer: they are sent until each kind is counted."""
        for data in hostile(random.Random(4), robot.listener.node.get_clock().now().nanoseconds):
            robot.imu.publish(data)
            time.sleep(0.005)
        shown = figures(robot.status())
        return all(int(shown.get(f"hal.imu/data {why}", 0)) >= n for why, n in least.items())

    robot.listener.until(refused)
    robot.obeys(2.0)
    robot.finish()


def test_a_publisher_of_another_type_is_not_heard(domain: Domain, library: Path) -> None:
    """ROS 2 matches by type: this topic has two."""
    other = domain.listener()
    stranger = other.node.create_publisher(String, "/imu/data", qos.STREAM)
    robot = Robot(domain, library)
    for _ in range(20):
        stranger.publish(String(data="1.0"))
    robot.obeys(3.0)
    assert stranger.get_subscription_count() == 0
    assert not [key for key in figures(robot.status()) if key in ("hal.imu/data malformed", "hal.imu/data truncated")]
    robot.finish()


# ---- subscribers and sensors that stop -----------------------------------------------------------------------------------


def test_a_stalled_subscriber_costs_no_tick(domain: Domain, library: Path) -> None:
    """Its subscription is reliable, and it reads nothing: only this subscriber loses messages beyond the history's
    depth.
    """
    counter = domain.start("topic_count", topics="[/motor/torque, /rig/state]")
    robot = Robot(domain, library)
    counter.wait_for("waiting for topics")
    robot.listener.until(lambda: robot.listener.node.count_subscribers("/motor/torque") == 2)
    counter.signal(signal.SIGSTOP)
    before = figures(robot.status())
    robot.obeys(1.0)
    robot.client.diagnosed(2)
    after = figures(robot.status())
    ticks, missed = (int(after[key]) - int(before[key]) for key in ("tick", "deadlines missed"))
    # A publish() that waited for the subscriber would wait 100 ms, ten ticks, each time.
    assert ticks > 100 and missed < ticks, (ticks, missed)
    robot.finish()


def test_a_count_ends_although_messages_flow_on(domain: Domain) -> None:
    counter, source = domain.start("topic_count", topics="[/flow]"), domain.listener()
    publisher = source.node.create_publisher(String, "/flow", qos.STREAM)
    source.until(lambda: publisher.get_subscription_count() == 1)
    end = threading.Event()

    def flow() -> None:
        while not end.wait(0.01):
            publisher.publish(String(data="more"))

    flowing = threading.Thread(target=flow)
    flowing.start()
    try:
        time.sleep(1.0)
        counter.signal(signal.SIGINT)
        assert counter.finish() == 0
    finally:
        end.set()
        flowing.join()
    assert json.loads(counter.out)["/flow"] > 50


def test_a_sensor_that_vanishes_is_told_by_its_age(domain: Domain, library: Path) -> None:
    robot = Robot(domain, library)
    robot.obeys(1.0)
    robot.listener.node.destroy_publisher(robot.imu)

    def level() -> bytes:
        return robot.client.diagnosed()[0]["rig: imu"].level

    robot.listener.until(lambda: level() != DiagnosticStatus.OK)
    assert robot.torque() == BIASED + 1.0, "outputs hold"
    robot.finish()


# ---- a second controller -----------------------------------------------------------------------------------------------------


def test_two_controllers_of_one_actuator_warn(domain: Domain, library: Path) -> None:
    robot = Robot(domain, library)
    second = domain.start("controller_node", "-r", "__node:=second", machine=library, mode="realtime")

    robot.obeys(1.0)

    def contested() -> bool:
        robot.sense(1.0)
        status = robot.status()
        return "motor/torque published by others" in status.message and status.level != DiagnosticStatus.OK

    robot.listener.until(contested)
    second.signal(signal.SIGINT)
    assert second.finish() == 0
    robot.listener.until(lambda: not contested())
    robot.finish()
