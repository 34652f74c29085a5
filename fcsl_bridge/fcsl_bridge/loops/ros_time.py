# SPDX-License-Identifier: Apache-2.0
"""ROS time at an instant of CLOCK_MONOTONIC, the clock that ticks are based on.

Both clocks run at the same rate, so their offset is constant until the system clock is set (a robot without a battery
for its clock gets the time from the network after the start). Simulated ROS time is that of the last /clock message, which
is polled, because callbacks run too rarely.
"""

from __future__ import annotations

import struct
import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from ..base.polling import PolledSubscription
from ..topics import qos

#: An offset is ignored if reading it took longer than this; a change by more than the second value is a set clock.
_HELD_UP_NS = 100_000
_SET_NS = 1_000_000
_TRIES = 5
#: A Clock as CDR: the encapsulation, seconds, nanoseconds.
_CLOCK = struct.Struct("<4xiI")
_NS = 1_000_000_000


class RosTime:
    """Of a node. `simulated`: that of /clock, instead of the system's clock."""

    def __init__(self, node: Node, simulated: bool):
        self._clock = node.get_clock()
        self.simulated = simulated
        self._simulated = PolledSubscription(node, Clock, "/clock", qos.SENSOR) if simulated else None
        self._simulated_ns = self._offset_ns = 0
        self.received = self.malformed = 0  #: messages of /clock
        self.sets = 0  #: how often follow() detected that the system clock was set
        self.start()

    def start(self) -> None:
        """Measures the offset: the quickest of several tries, because what holds one up is part of what it measures."""
        self._offset_ns, _ = min((self._distance() for _ in range(_TRIES)), key=lambda found: found[1])

    def at(self, monotonic_ns: int) -> int:
        """ROS time at that instant, in nanoseconds."""
        if self._simulated is None:
            return monotonic_ns + self._offset_ns
        for message in self._simulated.take_all():
            seconds, nanoseconds = _CLOCK.unpack_from(message) if len(message) >= _CLOCK.size else (-1, 0)
            if seconds < 0 or nanoseconds >= _NS:
                self.malformed += 1
            else:
                self._simulated_ns = seconds * _NS + nanoseconds
                self.received += 1
        return self._simulated_ns

    def wait(self, timeout_s: float) -> None:
        """Returns when a message of /clock may have come, or after timeout_s."""
        assert self._simulated is not None
        self._simulated.wait(timeout_s)

    def follow(self) -> None:
        """Adopts a system clock that was set by more than _SET_NS; call it occasionally."""
        offset, took_ns = self._distance()
        if took_ns <= _HELD_UP_NS and self._simulated is None and abs(offset - self._offset_ns) > _SET_NS:
            self._offset_ns = offset
            self.sets += 1

    def _distance(self) -> tuple[int, int]:
        """Offset of ROS time from CLOCK_MONOTONIC, and how long the measurement took, which bounds its error. In ns."""
        before = time.monotonic_ns()
        offset = int(self._clock.now().nanoseconds) - before
        return offset, time.monotonic_ns() - before

    def close(self) -> None:
        if self._simulated is not None:
            self._simulated.close()
