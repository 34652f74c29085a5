# SPDX-License-Identifier: Apache-2.0
"""A machine on the clock: it ticks at tick_hz, with the newest inputs and their ages, independent of its environment."""

from __future__ import annotations

import signal
import struct
import time
from pathlib import Path
from typing import Any

import pytest
import rig
from bridge_harness import Domain, Listener, Process
from controller_client import ACTIVATE, DEACTIVATE, ControllerClient, figures
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64

from fcsl_bridge.topics import qos
from fcsl_msgs.msg import MachineState
from fcsl_msgs.srv import Restore, Save, SetState
from simclient import AlgTwin
from simclient.bag import Bag
from simclient.replay import replay

HZ = 100
NS = 10**9


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rig.build(tmp_path_factory.mktemp("rig"), HZ)


class Robot:
    """An active controller of the rig, a publisher as IMU and a subscriber as motor."""

    def __init__(self, domain: Domain, library: Path, **parameters: Any):
        self.bag = domain.folder / "bag"
        self.library = library
        self.listener: Listener = domain.listener()
        self._imu = self.listener.node.create_publisher(Imu, "/imu/data", qos.STREAM)
        self.listener.subscribe(Float64, "/motor/torque", qos.COMMAND)
        self.torques = self.listener.received["/motor/torque"]
        given = {"mode": "realtime", "allow_set_state": True, "checkpoints": self.bag.parent, **parameters}
        self.process: Process = domain.start("controller_node", machine=library, record=self.bag, **given)
        self.client = ControllerClient(self.listener)
        assert self.client.call(SetState, "set_state", state="FLY").success
        self.listener.until(lambda: self._imu.get_subscription_count() == 1)
        self.wait_for_torque()

    def wait_for_torque(self) -> None:
        self.listener.until(lambda: bool(self.torques))

    def sense(self, rate: float, stamp_ns: int | None = None, frame: str = "imu_link") -> None:
        """Publishes a sample about the z axis, stamped now by default."""
        now = self.listener.node.get_clock().now().nanoseconds
        message = Imu()
        message.header.stamp = Time(nanoseconds=now if stamp_ns is None else stamp_ns).to_msg()
        message.header.frame_id = frame
        message.angular_velocity.z = rate
        self._imu.publish(message)

    def torque(self) -> float:
        return float(deserialize_message(self.torques[-1], Float64).data)

    def memory(self, *paths: str) -> list[Any]:
        """Values of the machine, from a checkpoint."""
        file = Path(f"{self.bag}_{time.monotonic_ns()}.checkpoint")
        assert self.client.call(Save, "save", file=file.name).success
        with AlgTwin.from_library(self.library) as twin:
            twin.restore(file.read_bytes())
            return [twin.get_value(path) for path in paths]

    def end(self, number: int = signal.SIGINT) -> int:
        self.process.signal(number)
        return self.process.finish()


@pytest.fixture
def robot(domain: Domain, library: Path) -> Robot:
    return Robot(domain, library)


def test_it_ticks_at_its_rate_and_says_so(robot: Robot) -> None:
    """Ticks plus missed deadlines equal the number of periods that elapsed."""
    began, first = time.monotonic(), robot.memory("machine.tick")[0]
    robot.listener.until(lambda: time.monotonic() - began > 2.0)
    (ticks,) = robot.memory("machine.tick")
    seconds = time.monotonic() - began
    shown = figures(robot.client.diagnosed()[0]["rig"])
    assert 0.5 * HZ * seconds - int(shown["deadlines missed"]) <= ticks - first <= HZ * (seconds + 0.5)
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


def test_a_sample_becomes_a_command(robot: Robot) -> None:
    """0.25 + 1.0 * rate; the sample's age and stamp are in the machine, and the sensor is valid."""
    stamp = robot.listener.node.get_clock().now().nanoseconds
    robot.sense(3.0, stamp)
    robot.listener.until(lambda: robot.torque() == 3.25)
    held, valid, rate = robot.memory("channels.imu.rate.stamp_ns", "channels.imu.rate.valid", "imu.outputs.rate")
    assert (held, valid, rate) == (stamp, True, [0.0, 0.0, 3.0])
    robot.listener.until(lambda: not robot.memory("channels.imu.rate.valid")[0])  # max_age_ticks without another
    assert robot.torque() == 3.25, "the last sample stays"
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


def test_an_old_sample_is_as_old_as_it_says(robot: Robot) -> None:
    stamp = robot.listener.node.get_clock().now().nanoseconds - 300_000_000
    robot.sense(2.0, stamp)
    robot.listener.until(lambda: robot.torque() == 2.25)
    age, ticks = robot.memory("channels.imu.rate.age_ticks", "machine.tick")
    assert robot.end() == 0
    bag = Bag(robot.bag)
    samples = [
        bag.decode_own(topic, data, ("tick", "kind", "age_ticks", "stamp_ns"))
        for topic, _, data in bag.messages()
        if topic == "/rig/record/writes"
    ]
    (sample,) = (s for s in samples if s.kind == 3)
    assert sample.stamp_ns == stamp and 30 <= sample.age_ticks < 100
    assert age == sample.age_ticks + ticks - 1 - sample.tick


def test_the_newest_sample_counts_and_what_is_refused_is_counted(robot: Robot) -> None:
    now = robot.listener.node.get_clock().now().nanoseconds
    robot.sense(1.0, now)
    robot.listener.until(lambda: robot.torque() == 1.25)
    robot.sense(7.0, frame="other_link")
    robot.process.wait_for("imu/data: refused: its frame is 'other_link', that of its channels 'imu_link'")
    robot.sense(float("nan"))
    robot.sense(7.0, now - NS)  # older than the one taken
    robot.sense(7.0, now + 3600 * NS)  # in the future
    refused = ("frame", "nan", "older", "future")
    while True:
        (message,) = robot.client.diagnosed()
        shown = figures(message["rig"])
        if all(f"hal.imu/data {reason}" in shown for reason in refused):
            break
    assert [shown[f"hal.imu/data {reason}"] for reason in refused] == ["1"] * 4
    assert robot.torque() == 1.25
    robot.sense(4.0)
    robot.listener.until(lambda: robot.torque() == 4.25)
    assert robot.end() == 0


def test_a_burst_between_two_ticks_ends_with_the_newest(robot: Robot) -> None:
    for rate in range(500):
        robot.sense(float(rate))
    robot.listener.until(lambda: robot.torque() == 499.25)
    shown = figures(robot.client.diagnosed()[0]["rig"])
    assert int(shown["hal.imu/data superseded"]) > 0
    assert robot.end() == 0


def test_a_stall_misses_ticks_and_makes_no_burst(robot: Robot) -> None:
    """The process is stopped for a second, as by a debugger."""
    robot.client.diagnosed()
    robot.process.signal(signal.SIGSTOP)
    time.sleep(1.0)
    robot.process.signal(signal.SIGCONT)
    while True:
        (message,) = robot.client.diagnosed()
        shown = figures(message["rig"])
        if int(shown["deadlines missed"]) >= HZ * 9 // 10:
            break
    assert float(shown["lateness worst us"]) > 900_000 and int(shown["lateness > 100000 us"]) >= 1
    assert " deadlines missed" in message["rig"].message and message["rig"].level != DiagnosticStatus.OK
    before = robot.memory("machine.tick")[0], time.monotonic()
    time.sleep(0.5)
    (ticks,) = robot.memory("machine.tick")
    assert ticks - before[0] <= HZ * (time.monotonic() - before[1] + 0.2), "old ticks were not caught up"
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


def test_executes_are_timed(robot: Robot) -> None:
    """An instance that takes longer than its max_wcet_us is degraded; a replay needs no clock for the same verdict."""
    assert robot.client.call(SetState, "set_state", state="SLOW").success
    while (status := robot.client.diagnosed()[0])["rig: slow"].level != DiagnosticStatus.WARN:
        pass
    assert status["rig: slow"].message.startswith("degraded") and int(figures(status["rig: slow"])["overruns"]) > 0
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


def test_stamps_are_ros_time(robot: Robot) -> None:
    robot.listener.subscribe(MachineState, "/rig/state", qos.LATCHED)
    states = robot.listener.received["/rig/state"]
    robot.listener.until(lambda: bool(states))
    second, nanosecond = struct.unpack_from("<iI", states[-1], 4)
    now = robot.listener.node.get_clock().now().nanoseconds
    assert 0 <= now - (second * NS + nanosecond) < 60 * NS
    assert robot.end() == 0
    bag = Bag(robot.bag)
    recorded = {log_ns: data for topic, log_ns, data in bag.messages() if topic == "/rig/state"}
    assert recorded[second * NS + nanosecond] == states[-1], "the bag has what was published, at its stamp"
    assert all(now - 60 * NS < log_ns < now + 60 * NS for _, log_ns, _ in bag.messages())


def test_outputs_hold_while_inactive_and_old_samples_are_forgotten(robot: Robot) -> None:
    robot.sense(1.0)
    robot.listener.until(lambda: robot.torque() == 1.25)
    assert robot.client.change(DEACTIVATE)
    robot.listener.until(lambda: robot.client.state == "inactive")
    count, (tick,) = len(robot.torques), robot.memory("machine.tick")
    robot.sense(9.0)
    time.sleep(0.3)
    assert robot.memory("machine.tick", "pilot.outputs.torque") == [tick, 1.25]
    robot.listener.until(lambda: True)
    assert len(robot.torques) <= count + 1
    assert robot.client.change(ACTIVATE)
    robot.listener.until(lambda: len(robot.torques) > count + 5)
    assert robot.torque() == 1.25, "samples received while inactive are dropped"
    robot.sense(2.0)
    robot.listener.until(lambda: robot.torque() == 2.25)
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


@pytest.mark.parametrize("how", ["deactivate", "interrupt", "terminate"])
def test_actuators_are_safe_when_ticking_ends(
    how: str, domain: Domain, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The last message of a command is its safe value; before, the machine was armed."""
    robot = Robot(domain, rig.build(tmp_path_factory.mktemp("rig"), HZ, safe=-7.0))
    robot.sense(1.0)
    robot.listener.until(lambda: robot.torque() == 1.25)
    if how == "deactivate":
        assert robot.client.change(DEACTIVATE)
        robot.listener.until(lambda: robot.torque() == -7.0)
        assert robot.client.change(ACTIVATE)
        robot.listener.until(lambda: robot.torque() == 1.25)
    assert robot.end(signal.SIGTERM if how == "terminate" else signal.SIGINT) == 0
    robot.listener.until(lambda: robot.torque() == -7.0)
    assert replay(robot.bag, library=str(robot.library)).identical


def test_an_armed_checkpoint_arms_nothing(domain: Domain, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A node that is disarmed gets one that was saved while armed: its actuators stay safe."""
    library = rig.build(tmp_path_factory.mktemp("rig"), HZ, safe=-7.0)
    robot = Robot(domain, library)
    robot.listener.until(lambda: robot.torque() == 0.25)
    disarmed, armed = "disarmed", "armed"
    assert robot.client.call(Save, "save", file=armed).success
    with AlgTwin.from_library(library) as twin:
        twin.set_state("SLOW")  # where nothing arms it
        twin.save_file(robot.bag.parent / disarmed)
    assert robot.client.call(Restore, "restore", file=disarmed).success
    robot.listener.until(lambda: robot.torque() == -7.0)
    assert robot.client.call(Restore, "restore", file=armed).success
    count = len(robot.torques)
    robot.listener.until(lambda: len(robot.torques) >= count + 20)
    values = {float(deserialize_message(torque, Float64).data) for torque in robot.torques[count:]}
    assert values == {-7.0} and robot.memory("pilot.outputs.on") == [True]
    assert robot.end() == 0
    assert replay(robot.bag, library=str(robot.library)).identical


def test_a_killed_controller_leaves_a_bag_that_replays(robot: Robot) -> None:
    for rate in range(20):
        robot.sense(float(rate))
        robot.listener.until(lambda: True)
    robot.client.diagnosed(2)
    robot.process.signal(signal.SIGKILL)
    robot.process.finish()
    verdict = replay(robot.bag, library=str(robot.library))
    assert verdict.divergence is None and verdict.ticks > HZ // 2


def test_simulated_time_that_stops_stops_no_tick(domain: Domain, library: Path) -> None:
    """With use_sim_time and without /clock: stamps do not advance, the machine does, and the node says what it lacks."""
    robot = Robot(domain, library, use_sim_time=True)
    (first,) = robot.memory("machine.tick")
    count = len(robot.torques)
    robot.listener.until(lambda: len(robot.torques) >= count + 20)
    assert robot.memory("machine.tick")[0] > first
    robot.process.wait_for("no message of /clock has come within 2 s: with use_sim_time all stamps are 0 until")
    assert robot.end() == 0


def test_sensors_of_a_simulator_are_as_new_as_its_clock(domain: Domain, library: Path) -> None:
    """A simulator of another make: /clock and samples at 100 Hz with the same stamps. Callbacks, at 50 Hz at most,
    would read the time too late."""
    robot = Robot(domain, library, use_sim_time=True)
    clock = robot.listener.node.create_publisher(Clock, "/clock", qos.STREAM)
    robot.listener.until(lambda: clock.get_subscription_count() == 2)  # rclpy's own, too
    for tick in range(1, 201):
        stamp_ns = tick * NS // HZ
        clock.publish(Clock(clock=Time(nanoseconds=stamp_ns).to_msg()))
        robot.sense(float(tick), stamp_ns)
        time.sleep(1 / HZ)
    robot.listener.until(lambda: robot.torque() == 200.25)
    shown = figures(robot.client.diagnosed(2)[1]["rig"])
    assert "hal.imu/data future" not in shown and int(shown["hal.imu/data taken"]) > 100
    assert robot.end() == 0


def test_a_clock_of_another_speed_is_told(domain: Domain, library: Path) -> None:
    """A bag at 3 times real time: the machine's time is not that of /clock."""
    robot = Robot(domain, library, use_sim_time=True)
    clock = robot.listener.node.create_publisher(Clock, "/clock", qos.STREAM)
    began_ns = time.monotonic_ns()
    while "the machine's time is not that of /clock. With mode:=clock it is" not in robot.process.err:
        clock.publish(Clock(clock=Time(nanoseconds=NS + 3 * (time.monotonic_ns() - began_ns)).to_msg()))
        time.sleep(1 / HZ)
        assert robot.process.process.poll() is None
    status = robot.client.diagnosed()[0]["rig"]
    assert int(figures(status)["times /clock and ticks parted"]) >= 1
    assert robot.end() == 0


@pytest.mark.parametrize(("stamp_ns", "direction"), [(2 * NS, "before"), (2_100_000_000 * NS, "after")])
def test_stamps_of_another_clock_are_told(robot: Robot, stamp_ns: int, direction: str) -> None:
    """A driver that counts from its start; and one whose date is wrong."""
    robot.sense(1.0, stamp_ns)
    robot.process.wait_for(f"s {direction} the time of this node, which is that of the system's clock")
    if direction == "before":
        while "its samples have stamps of another clock" not in robot.client.diagnosed()[0]["rig: imu"].message:
            pass
    assert robot.end() == 0


@pytest.mark.parametrize(
    ("ahead_s", "said"),
    [
        (
            18,
            "stamped 18 s after the time of this node, which is that of the system's clock: its sender has another clock "
            "(GPS and UTC are so far apart)",
        ),
        (
            -37,
            "stamped 37 s before the time of this node, which is that of the system's clock: its sender has another clock "
            "(TAI and UTC are so far apart)",
        ),
    ],
)
def test_a_sensor_on_another_time_scale_is_told(robot: Robot, ahead_s: int, said: str) -> None:
    """A driver that stamps with a GNSS receiver's time, or a computer that is set to TAI."""
    while said not in robot.process.err:
        robot.sense(1.0, time.time_ns() + ahead_s * NS)
        time.sleep(1 / HZ)
        assert robot.process.process.poll() is None
    assert robot.end() == 0


def test_a_sensor_that_is_late_is_of_no_other_clock(robot: Robot) -> None:
    for _ in range(4 * HZ):  # the node looks once a second
        robot.sense(1.0, time.time_ns() - 10 * NS)
        time.sleep(1 / HZ)
    assert robot.end() == 0 and "another clock" not in robot.process.err


def test_a_second_publisher_of_a_sensor_is_told(robot: Robot) -> None:
    robot.listener.node.create_publisher(Imu, "/imu/data", qos.STREAM)
    while "hal.imu/data has several publishers" not in robot.client.diagnosed()[0]["rig"].message:
        pass
    assert robot.end() == 0
