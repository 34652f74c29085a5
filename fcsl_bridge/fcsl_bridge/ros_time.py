# SPDX-License-Identifier: Apache-2.0
"""ROS time for what happens at an instant of CLOCK_MONOTONIC, which alone makes ticks.

Both clocks run at the same rate, so the distance between them stays what it was, until somebody sets the system clock (a
robot without a battery for it learns the time from the network after it has started). With use_sim_time it is what /clock
said last.
"""

from __future__ import annotations

import time

from rclpy.clock import Clock

#: A distance that was read while the process was held up says nothing; one that changed by more than this was set.
_HELD_UP_NS = 1_000_000
_SET_NS = 10_000_000
_TRIES = 5


class RosTime:
    """`clock`: a node's."""

    def __init__(self, clock: Clock):
        self._clock = clock
        self._offset_ns = 0
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
        return int(self._clock.now().nanoseconds) if self._clock.ros_time_is_active else monotonic_ns + self._offset_ns

    def follow(self) -> None:
        """To be called now and then: takes over a system clock that was set, by more than _SET_NS."""
        offset, held_up = self._distance()
        if not held_up and not self._clock.ros_time_is_active and abs(offset - self._offset_ns) > _SET_NS:
            self._offset_ns = offset
            self.sets += 1

    def _distance(self) -> tuple[int, bool]:
        """Of ROS time from CLOCK_MONOTONIC in nanoseconds, and whether it says nothing."""
        before = time.monotonic_ns()
        offset = int(self._clock.now().nanoseconds) - before
        return offset, time.monotonic_ns() - before > _HELD_UP_NS
