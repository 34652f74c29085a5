# SPDX-License-Identifier: Apache-2.0
"""Whether ticks and /clock go on alike: every tick stands for one period, whatever time passes between two of them."""

from __future__ import annotations

from rclpy.node import Node

from simclient.descriptor import Machine

#: How much of the ticks' time is compared at once, in ns, and how far apart both may be in it.
_WINDOW_NS = 5_000_000_000
_ALLOWED = 0.05


class ClockDrift:
    """Of a node that ticks in real time and has stamps of /clock."""

    def __init__(self, node: Node, machine: Machine):
        self._node, self._machine = node, machine
        self._tick = self._clock_ns = 0
        self.times = 0  #: windows in which they parted

    def start(self) -> None:
        """Compares from the next call of `look` on."""
        self._clock_ns = 0

    def check(self, tick: int, clock_ns: int) -> None:
        """`clock_ns`: the time of /clock at tick `tick`, 0 before there is one. Call it often."""
        ticked_ns, went_ns = self._machine.time_ns(tick) - self._machine.time_ns(self._tick), clock_ns - self._clock_ns
        if self._clock_ns == 0 or went_ns < 0 or ticked_ns < 0:
            self._tick, self._clock_ns = tick, clock_ns
        elif ticked_ns >= _WINDOW_NS:
            self._tick, self._clock_ns = tick, clock_ns
            if abs(went_ns - ticked_ns) > _ALLOWED * ticked_ns:
                self.times += 1
                self._warn(ticked_ns / 1e9, went_ns / 1e9)

    def _warn(self, ticked_s: float, went_s: float) -> None:
        if self.times == 1:
            self._node.get_logger().warning(
                f"/clock went on by {went_s:.1f} s and the ticks by {ticked_s:.1f} s: the machine's time is not that of "
                "/clock. With mode:=clock it is: /clock then makes the ticks due"
            )
