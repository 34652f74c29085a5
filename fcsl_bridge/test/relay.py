# SPDX-License-Identifier: Apache-2.0
"""Forwards bundles from one topic to another, and drops, repeats or damages that of one tick.

relay.py SOURCE TARGET TICK drop|hold|repeat|skip|corrupt|alien|name
"""

from __future__ import annotations

import os
import sys

from fcsl_bridge.loopback import loopback_environment

os.environ.update(loopback_environment(os.environ))

import rclpy  # noqa: E402
from rclpy.executors import ExternalShutdownException  # noqa: E402

from fcsl_bridge import qos  # noqa: E402
from fcsl_msgs.msg import TickBundle  # noqa: E402

source, target, tick, deed = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4]
HOLD_S = 0.3

rclpy.init()
node = rclpy.create_node("relay")
publisher = node.create_publisher(TickBundle, target, qos.LOCKSTEP)
held = []


def take(bundle: TickBundle) -> None:
    if bundle.tick != tick or deed == "repeat":
        publisher.publish(bundle)
    if bundle.tick != tick:
        return
    if deed == "repeat":
        publisher.publish(bundle)
    elif deed == "hold":
        held.append(bundle)
        node.create_timer(HOLD_S, lambda: publisher.publish(held.pop()) if held else None)
    elif deed == "skip":
        bundle.tick += 1
        publisher.publish(bundle)
    elif deed == "corrupt":
        bundle.message[30] ^= 0x10
        publisher.publish(bundle)
    elif deed == "alien":
        bundle.machine = 255
        publisher.publish(bundle)
    elif deed == "name":
        bundle.header.frame_id = "map"
        publisher.publish(bundle)


node.create_subscription(TickBundle, source, take, qos.LOCKSTEP)
print("relaying", flush=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pass
