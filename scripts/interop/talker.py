# SPDX-License-Identifier: Apache-2.0
"""The talker of `make interop`: an rclpy node as users write them. `talker.py FIRST COUNT`: publishes that many messages, 100 a
second, each with its number, once somebody subscribes.
"""

from __future__ import annotations

import sys
import time

import rclpy
from sensor_msgs.msg import Imu

PERIOD_S = 0.01
#: For the subscription, and at the end for the last messages, in s.
WAIT_S, END_S = 30.0, 1.0


def main() -> None:
    first, count = int(sys.argv[1]), int(sys.argv[2])
    rclpy.init()
    node = rclpy.create_node("talker")
    publisher = node.create_publisher(Imu, "imu/data", 10)
    deadline = time.monotonic() + WAIT_S
    while publisher.get_subscription_count() == 0:
        if time.monotonic() > deadline:
            sys.exit("talker: nobody subscribes to imu/data")
        time.sleep(0.05)
    time.sleep(END_S)  # for the subscriber to know this publisher, too
    begun = time.monotonic()
    for number in range(first, first + count):
        message = Imu()
        message.header.stamp = node.get_clock().now().to_msg()
        message.angular_velocity.x = float(number)
        publisher.publish(message)
        time.sleep(max(0.0, begun + (number - first + 1) * PERIOD_S - time.monotonic()))
    time.sleep(END_S)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
