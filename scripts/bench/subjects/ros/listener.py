# SPDX-License-Identifier: Apache-2.0
"""Takes the topics of the rig's axes raw, and prints as JSON what it saw in a window of time: delays in nanoseconds from
the deadline in the stamp to the callback here, ticks, and the processor time that process PID used meanwhile.

    python3 listener.py PID AXES WARM_UP_S WINDOW_S

The warm-up begins with the first message: on a busy computer a node needs seconds to start.
"""

from __future__ import annotations

import gc
import json
import os
import struct
import sys
import time
from pathlib import Path

import bench_rig.msg
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

#: A node that published nothing by then is given up, seconds.
FIRST_WITHIN_S = 60.0
_NS = 1_000_000_000
#: Encapsulation, stamp, empty frame_id, tick.
_HEAD = struct.Struct("<4xiI8xQ")


def processor_s(pid: int) -> float:
    """Seconds that the process has run, in all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Listener(Node):
    def __init__(self, axes: int) -> None:
        super().__init__("listener")
        self.seen: list[tuple[int, int, int]] = []  # stamp, tick, delay
        self.figures: dict[str, str] = {}
        for i in range(axes):
            kind = getattr(bench_rig.msg, f"RigAxis{i:02d}")
            self.create_subscription(kind, f"rig/axis_{i:02d}", self.take, QoSProfile(depth=1000), raw=True)
        self.create_subscription(DiagnosticArray, "/diagnostics", self.diagnosed, 10)

    def take(self, data: bytes) -> None:
        now = time.time_ns()
        seconds, nanoseconds, tick = _HEAD.unpack_from(data)
        stamp = seconds * _NS + nanoseconds
        self.seen.append((stamp, tick, now - stamp))

    def diagnosed(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.figures |= {value.key: value.value for value in status.values}

    def spin(self, executor: EventsExecutor, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            executor.spin_once(timeout_sec=left)


def main() -> None:
    pid, axes, warm_up_s, window_s = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
    rclpy.init()
    node = Listener(axes)
    executor = EventsExecutor()
    executor.add_node(node)
    given_up = time.monotonic() + FIRST_WITHIN_S
    while not node.seen and time.monotonic() < given_up:
        executor.spin_once(timeout_sec=1.0)
    node.spin(executor, warm_up_s)
    node.seen.clear()
    gc.disable()  # a collection here would look like a delay there
    begun, used = time.monotonic(), processor_s(pid)
    node.spin(executor, window_s)
    took, used = time.monotonic() - begun, processor_s(pid) - used
    stamps, ticks, delays = zip(*node.seen, strict=True) if node.seen else ((0,), (0,), ())
    facts = {
        "messages": len(delays),
        "ticks": max(ticks) - min(ticks),
        "deadlines": round((max(stamps) - min(stamps)) * 1000 / _NS),
        "processor": used / took,
        "delays_ns": delays,
        "diagnostics": node.figures,
    }
    print(json.dumps(facts))


if __name__ == "__main__":
    main()
