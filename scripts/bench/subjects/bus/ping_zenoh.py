# SPDX-License-Identifier: Apache-2.0
"""Zenoh's own round trip between two Python programs, as its example z_ping does it.

python3 ping_zenoh.py pong ENDPOINT
python3 ping_zenoh.py ping ENDPOINT BYTES COUNT     prints the round trips in ns as JSON
"""

from __future__ import annotations

import json
import queue
import sys
import time
from typing import Any

import zenoh

WARM_UP = 50


def session(role: str, endpoint: str) -> Any:
    config = zenoh.Config.from_json5("{scouting: {multicast: {enabled: false}, gossip: {enabled: false}}}")
    config.insert_json5("mode", '"peer"' if role == "listen" else '"client"')
    config.insert_json5(f"{role}/endpoints", json.dumps([endpoint]))
    config.insert_json5("connect/timeout_ms", "30000")
    return zenoh.open(config)


def pong(endpoint: str) -> None:
    with session("listen", endpoint) as bus:
        back = bus.declare_publisher("bench/pong", congestion_control=zenoh.CongestionControl.BLOCK)
        bus.declare_subscriber("bench/ping", lambda sample: back.put(sample.payload))
        print("ready", flush=True)
        sys.stdin.read()


def ping(endpoint: str, size: int, count: int) -> list[int]:
    came: queue.SimpleQueue[bool] = queue.SimpleQueue()
    with session("connect", endpoint) as bus:
        bus.declare_subscriber("bench/pong", lambda sample: came.put(True))
        there = bus.declare_publisher("bench/ping", congestion_control=zenoh.CongestionControl.BLOCK)
        while not there.matching_status.matching:
            time.sleep(0.01)
        trips, data = [], bytes(size)
        for _ in range(WARM_UP + count):
            begun = time.perf_counter_ns()
            there.put(data)
            came.get(timeout=60)
            trips.append(time.perf_counter_ns() - begun)
    return trips[WARM_UP:]


if __name__ == "__main__":
    if sys.argv[1] == "pong":
        pong(sys.argv[2])
    else:
        print(json.dumps(ping(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))))
