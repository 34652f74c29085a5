# SPDX-License-Identifier: Apache-2.0
"""What the machine of subjects/ros does, as an ordinary rclpy node: a timer at 1 kHz, a publisher for each axis, every
twentieth result published.

    python3 plain_node.py AXES

The stamp is the deadline that the timer served, on a grid from its creation, so that delays compare with controller_node's.
"""

from __future__ import annotations

import json
import math
import sys
import time

import bench_rig.msg
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

DT = 0.001
PERIOD_NS = 1_000_000
DECIMATE = 20


class Axis:
    def __init__(self, frequency: float):
        self.frequency = frequency
        self.phase = self.reference = self.position = self.speed = self.torque = 0.0
        self.saturated = False

    def execute(self) -> None:
        self.phase += self.frequency * DT
        self.reference = math.sin(self.phase)
        wanted = 400.0 * (self.reference - self.position) - 40.0 * self.speed
        self.torque = min(max(wanted, -50.0), 50.0)
        self.saturated = self.torque != wanted
        self.speed += self.torque * DT
        self.position += self.speed * DT


class PlainNode(Node):
    def __init__(self, axes: int) -> None:
        super().__init__("plain_node")
        self.axes = [Axis(1.0 + i / 2) for i in range(axes)]
        self.kinds = [getattr(bench_rig.msg, f"RigAxis{i:02d}") for i in range(axes)]
        self.outputs = [self.create_publisher(kind, f"rig/axis_{i:02d}", 10) for i, kind in enumerate(self.kinds)]
        self.begun_ns, self.offset_ns = time.monotonic_ns(), time.time_ns() - time.monotonic_ns()
        self.tick = self.deadline = self.missed = 0
        self.timer = self.create_timer(DT, self.on_timer)

    def on_timer(self) -> None:
        passed_ns = time.monotonic_ns() - self.begun_ns
        deadline = passed_ns // PERIOD_NS
        self.missed += max(0, deadline - self.deadline - 1)
        self.deadline = deadline
        for axis in self.axes:
            axis.execute()
        if self.tick % DECIMATE == 0:
            self.publish(self.begun_ns + deadline * PERIOD_NS + self.offset_ns)
        self.tick += 1

    def publish(self, stamp_ns: int) -> None:
        for axis, kind, output in zip(self.axes, self.kinds, self.outputs, strict=True):
            message = kind()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
            message.tick = self.tick
            message.reference = axis.reference
            message.position = axis.position
            message.speed = axis.speed
            message.torque = axis.torque
            message.saturated = axis.saturated
            output.publish(message)


def main() -> None:
    rclpy.init()
    node = PlainNode(int(sys.argv[1]))
    try:
        rclpy.spin(node)
    except (
        KeyboardInterrupt,
        ExternalShutdownException,
        RCLError,
    ):  # what a signal becomes depends on where it arrives
        print(json.dumps({"ticks": node.tick, "missed": node.missed}))


if __name__ == "__main__":
    main()
