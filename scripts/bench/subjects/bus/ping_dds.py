# SPDX-License-Identifier: Apache-2.0
"""The round trip of Fast DDS between two rclpy programs: messages as bytes, and a wait set of one subscription.

python3 ping_dds.py pong
python3 ping_dds.py ping BYTES COUNT      prints the round trips in ns as JSON
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import UInt8MultiArray

from fcsl_bridge.base.polling import PolledSubscription

WARM_UP = 50
_QOS = QoSProfile(depth=10)
#: Bytes of such a message around its data: encapsulation, an empty layout, the length.
_AROUND = 20


def pong(node: Node) -> None:
    polled = PolledSubscription(node, UInt8MultiArray, "bench/ping", _QOS)
    back = node.create_publisher(UInt8MultiArray, "bench/pong", _QOS)
    print("ready", flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    while True:
        polled.wait(1.0)
        for data in polled.take_all():
            back.publish(data)


def ping(node: Node, size: int, count: int) -> list[int]:
    polled = PolledSubscription(node, UInt8MultiArray, "bench/pong", _QOS)
    there = node.create_publisher(UInt8MultiArray, "bench/ping", _QOS)
    while there.get_subscription_count() == 0 or node.count_publishers("bench/pong") == 0:
        time.sleep(0.05)
    data = serialize_message(UInt8MultiArray(data=bytes(max(0, size - _AROUND))))
    trips, limit = [], time.monotonic() + 60
    for _ in range(WARM_UP + count):
        begun = time.perf_counter_ns()
        there.publish(data)
        while polled.take() is None:
            polled.wait(1.0)
            assert time.monotonic() < limit, "no answer"
        trips.append(time.perf_counter_ns() - begun)
    return trips[WARM_UP:]


if __name__ == "__main__":
    rclpy.init()
    own = Node(f"bench_{sys.argv[1]}")
    if sys.argv[1] == "pong":
        pong(own)
    else:
        print(json.dumps(ping(own, int(sys.argv[2]), int(sys.argv[3]))))
