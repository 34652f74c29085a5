# SPDX-License-Identifier: Apache-2.0
"""ROS time for what happens at an instant of CLOCK_MONOTONIC, which alone makes ticks.

Both clocks run at the same rate, so the distance between them stays what it was, until somebody sets the system clock (a
robot without a battery for it learns the time from the network after it has started). With use_sim_time, as it was when
the node was configured, it is what /clock said last; that is polled, because callbacks come too seldom to tell the time.
"""

from __future__ import annotations

import struct
import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from . import qos
from .polled import Polled

#: A distance that was read while the process was held up for longer says nothing; one that changed by more was set.
_HELD_UP_NS = 100_000
_SET_NS = 1_000_000
_TRIES = 5
#: A Clock as CDR: the encapsulation, seconds, nanoseconds.
_CLOCK = struct.Struct("<4xiI")
_NS = 1_000_000_000


class RosTime:
    """Of a node."""

    def __init__(self, node: Node):
        self._clock = node.get_clock()
        simulated = node.get_parameter("use_sim_time").value
        self._simulated = Polled(node, Clock, "/clock", qos.SENSOR) if simulated else None
        self._simulated_ns = self._offset_ns = 0
        self.sets = 0  #: how often follow() found the system clock set
        self.start()

    def start(self) -> None:
        """Takes the distance as it is."""
        for _ in range(_TRIES):
            self._offset_ns, held_up = self._distance()
            if not held_up:
                return

    def at(self, monotonic_ns: int) -> int:
        """ROS time at that instant, in nanoseconds."""
        if self._simulated is None:
            return monotonic_ns + self._offset_ns
        for said in self._simulated.take_all():
            if len(said) >= _CLOCK.size:
                seconds, nanoseconds = _CLOCK.unpack_from(said)
                self._simulated_ns = seconds * _NS + nanoseconds
        return self._simulated_ns

    def follow(self) -> None:
        """To be called now and then: takes over a system clock that was set, by more than _SET_NS."""
        offset, held_up = self._distance()
        if not held_up and self._simulated is None and abs(offset - self._offset_ns) > _SET_NS:
            self._offset_ns = offset
            self.sets += 1

    def _distance(self) -> tuple[int, bool]:
        """Of ROS time from CLOCK_MONOTONIC in nanoseconds, and whether it says nothing."""
        before = time.monotonic_ns()
        offset = int(self._clock.now().nanoseconds) - before
        return offset, time.monotonic_ns() - before > _HELD_UP_NS

    def close(self) -> None:
        if self._simulated is not None:
            self._simulated.close()
