# SPDX-License-Identifier: Apache-2.0
"""The listener of `make interop`: an rclpy node as users write them, on use_sim_time. Says that it listens. Runs until SIGTERM, then
prints what it saw as JSON: of each topic how many messages, how many are missing between the first and the last, how many came twice or out of order.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from typing import Any

import rclpy
from geometry_msgs.msg import TwistStamped
from lander.msg import LanderControlDescent, LanderControlSensors
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock

from fcsl_msgs.msg import MachineState, TransitionEvent

#: In s of wall time: when the late subscription is made.
LATE_S = 8.0
HZ = 100


class Sequence:
    """Counts numbers that should grow by one."""

    def __init__(self) -> None:
        self.count = self.missing = self.twice = 0
        self.last: int | None = None

    def see(self, number: int) -> None:
        self.count += 1
        if self.last is not None and number <= self.last:
            self.twice += 1
            return
        if self.last is not None:
            self.missing += number - self.last - 1
        self.last = number

    def as_json(self) -> dict[str, int | None]:
        return {"messages": self.count, "missing": self.missing, "twice": self.twice, "last": self.last}


def ticks(stamp: Any) -> int:
    return int((stamp.sec * 10**9 + stamp.nanosec) * HZ // 10**9)


def main() -> None:
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node = rclpy.create_node("listener", parameter_overrides=[Parameter("use_sim_time", value=True)])
    seen = {name: Sequence() for name in ("clock", "descent", "sensors", "commands", "transitions", "late state")}
    ahead = [0]
    stamps: list[int] = [0]

    def heard(message: LanderControlDescent) -> None:
        seen["descent"].see(message.tick)
        ahead[0] = max(ahead[0], message.tick - node.get_clock().now().nanoseconds * HZ // 10**9)

    def commanded(message: TwistStamped) -> None:
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        seen["commands"].count += 1
        seen["commands"].twice += stamp <= stamps[0]
        stamps[0] = stamp
        seen["commands"].last = round(message.twist.linear.x)

    deep = QoSProfile(depth=2000)
    node.create_subscription(Clock, "/clock", lambda m: seen["clock"].see(ticks(m.clock)), deep)
    node.create_subscription(LanderControlDescent, "lander_control/descent", heard, deep)
    node.create_subscription(
        LanderControlSensors, "lander_control/sensors", lambda m: seen["sensors"].see(m.tick), deep
    )
    node.create_subscription(TwistStamped, "cmd_vel", commanded, deep)
    node.create_subscription(
        TransitionEvent, "lander_control/transitions", lambda m: seen["transitions"].see(m.tick), deep
    )
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: ended.append(number))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    print("listening", flush=True)
    begun, late = time.monotonic(), False
    while not ended:
        rclpy.spin_once(node, timeout_sec=0.1)
        if not late and time.monotonic() - begun > LATE_S:
            late = True
            node.create_subscription(
                MachineState, "lander_control/state", lambda m: seen["late state"].see(m.tick), latched
            )
    json.dump({name: of.as_json() for name, of in seen.items()} | {"ticks ahead of the clock": ahead[0]}, sys.stdout)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
