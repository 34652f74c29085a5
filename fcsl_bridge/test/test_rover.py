# SPDX-License-Identifier: Apache-2.0
"""The rover on a ROS graph: an operator, and wheels whose topics are those of ros2_control's controllers."""

from __future__ import annotations

import json
import math
import signal
import time
from pathlib import Path

import pytest
from bridge_harness import Domain
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_system_default
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray, Int32

from fcsl_bridge.base.machine_index import find_machine
from fcsl_bridge.topics import qos
from fcsl_msgs.msg import MachineState
from simclient.replay import replay

HZ = 100
ROVER = Path(__file__).parents[2] / "examples/rover/fc"
GEOMETRY = json.loads((ROVER / "geometry.json").read_text())
STOP, BY_HAND, ROUTE = 0, 1, 2


class Wheels:
    """A stand-in of ros2_control's joint_state_broadcaster and forward_command_controller (velocity), which no registry
    has: what they take and send is read off ros2_controllers, commit 94e74de.
    """

    def __init__(self, robot: Robot):
        node = robot.listener.node
        self.angles = {"right_wheel": 0.0, "left_wheel": 0.0}  # in the order of the hardware's description
        self.speeds = [0.0, 0.0]
        self.commands = 0
        self._states = node.create_publisher(JointState, "joint_states", qos_profile_system_default)
        node.create_subscription(Float64MultiArray, "wheel_controller/commands", self._command, qos.COMMAND)

    def _command(self, message: Float64MultiArray) -> None:
        self.commands += 1
        assert len(message.data) == 2, "the controller would fail in its update"
        if all(map(math.isfinite, message.data)):
            self.speeds = list(message.data)

    def publish(self, stamp: Time) -> None:
        """What the state interfaces do not have is NaN."""
        names, unknown = list(self.angles), [math.nan] * 2
        message = JointState(name=names, position=list(self.angles.values()), velocity=unknown, effort=unknown)
        message.header.stamp = stamp.to_msg()
        self._states.publish(message)

    def turn(self) -> None:
        for name, speed in zip(("left_wheel", "right_wheel"), self.speeds, strict=True):
            self.angles[name] += speed / HZ


class Robot:
    """A controller of the rover on this /clock, its wheels, and an operator, whose topics have what `say` was given."""

    def __init__(self, domain: Domain):
        self.bag = domain.folder / "bag"
        self.listener = domain.listener()
        node = self.listener.node
        self._clock = node.create_publisher(Clock, "/clock", qos.STREAM)
        kinds = {"cmd_vel": Twist, "mode": Int32, "emergency_stop": Bool}
        self._operator = {name: node.create_publisher(kind, name, 10) for name, kind in kinds.items()}
        self.said: dict[str, Twist | Int32 | Bool] = {}
        self.wheels = Wheels(self)
        self.listener.subscribe(Odometry, "/odom", qos.COMMAND)
        self.listener.subscribe(MachineState, "/rover/state", qos.LATCHED)
        self.process = domain.start("controller_node", machine="rover/rover", mode="clock", record=self.bag)
        self._ticks = 0
        publishers = [self._clock, self.wheels._states, *self._operator.values()]
        self.listener.until(lambda: all(p.get_subscription_count() == 1 for p in publishers))
        for _ in range(60):  # answers are lost until the node has found the wheels
            self._send()
            again = time.monotonic() + 1.0
            self.listener.until(lambda: self.wheels.commands > 0 or time.monotonic() > again)  # noqa: B023
            if self.wheels.commands:
                return
        raise AssertionError("no command has come")

    def say(self, mode: int | None = None, speed: float = 0.0, yaw_rate: float = 0.0, stop: bool = False) -> None:
        """mode: None for nothing at all from now on."""
        twist = Twist()
        twist.linear.x, twist.angular.z = speed, yaw_rate
        spoken = {"cmd_vel": twist, "mode": Int32(data=mode or 0), "emergency_stop": Bool(data=stop)}
        self.said = {} if mode is None else spoken

    def tick(self, seconds: float) -> None:
        """So much time, tick by tick: each is answered by a command."""
        for _ in range(round(seconds * HZ)):
            answered = self.wheels.commands
            self._send()
            self.listener.until(lambda: self.wheels.commands > answered)  # noqa: B023
            self.wheels.turn()

    def _send(self) -> None:
        """What is known at the next tick, and the time of it."""
        self._ticks += 1
        stamp = Time(nanoseconds=self._ticks * 10**9 // HZ)
        self.wheels.publish(stamp)
        for name, message in self.said.items():
            self._operator[name].publish(message)
        self._clock.publish(Clock(clock=stamp.to_msg()))

    @property
    def state(self) -> str:
        return str(deserialize_message(self.listener.received["/rover/state"][-1], MachineState).state)

    @property
    def odometry(self) -> Odometry:
        return deserialize_message(self.listener.received["/odom"][-1], Odometry)


def test_drive(domain: Domain) -> None:
    robot = Robot(domain)
    wheels = robot.wheels
    robot.say(STOP)
    robot.tick(0.5)
    assert robot.state == "STOPPED" and wheels.speeds == [0.0, 0.0]

    robot.say(BY_HAND, 0.6, 0.4)
    robot.tick(2.0)
    half, radius = GEOMETRY["wheel_separation"]["value"] / 2, GEOMETRY["wheel_radius"]["value"]
    assert robot.state == "MANUAL"
    assert wheels.speeds == pytest.approx([(0.6 - 0.4 * half) / radius, (0.6 + 0.4 * half) / radius], rel=1e-9)
    moving = robot.odometry.twist.twist
    assert (moving.linear.x, moving.angular.z) == pytest.approx((0.6, 0.4), rel=0.02)

    # An encoder that gives no number is silent: 0.1 s later nothing moves, whatever the operator says.
    angle, wheels.angles["right_wheel"] = wheels.angles["right_wheel"], math.nan
    robot.tick(0.2)
    assert robot.state == "EMERGENCY" and wheels.speeds == [0.0, 0.0]
    wheels.angles["right_wheel"] = angle
    robot.say(STOP)
    robot.tick(0.3)
    assert robot.state == "STOPPED"

    robot.say(ROUTE)
    robot.tick(3.0)
    assert robot.state == "FOLLOW" and min(wheels.speeds) > 0.0
    robot.say(ROUTE, stop=True)
    robot.tick(0.05)
    assert robot.state == "EMERGENCY" and wheels.speeds == [0.0, 0.0]
    robot.say(STOP)
    robot.tick(0.3)
    assert robot.state == "STOPPED"

    robot.say(BY_HAND, 0.6)
    robot.tick(1.0)
    assert min(wheels.speeds) > 0.0
    robot.process.signal(signal.SIGINT)
    robot.listener.until(lambda: wheels.speeds == [0.0, 0.0])
    assert robot.process.finish() == 0
    library, _ = find_machine("rover/rover")
    assert replay(robot.bag, library=str(library)).identical
