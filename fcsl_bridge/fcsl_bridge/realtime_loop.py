# SPDX-License-Identifier: Apache-2.0
"""Runs a machine on the robot's clock: one tick at each deadline of pacer.py, with the newest inputs.

The thread that steps does all other work in the slack before the next deadline; no callback causes a tick. Stamps are
ROS time at the deadline of a tick (ros_time.py), in topics and in the bag; a change of the system clock is detected
within a second. Tick numbers count steps: a missed deadline is not a tick.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from .diagnostics import Figures
from .hosted import Hosted
from .mapped_topics import Inputs
from .pacer import Pacer, sleep_until
from .polled import SERVE_PERIOD_S
from .ros_time import RosTime

_NS = 1_000_000_000
_SLICE_NS = int(SERVE_PERIOD_S * _NS)
#: Callbacks run when half a period is left after a tick with little output, and at least this often.
_SERVE_AT_LEAST_NS = 5 * _SLICE_NS


class RealtimeLoop:
    """`serve` runs the node's other callbacks, and raises what ends the ticking."""

    def __init__(self, node: Node, hosted: Hosted, serve: Callable[[], None], options: Mapping[str, Any]):
        self._hosted, self._serve = hosted, serve
        self._inputs = Inputs(node, hosted.run)
        self._time = RosTime(node)
        self._pacer = Pacer(hosted.run.machine.tick_hz)
        self._roomy_ns = _NS // hosted.run.machine.tick_hz // 2
        self._stamp_ns = self._serve_by_ns = 0
        hosted.sources.append(self)
        hosted.run.time_executes()
        unmapped = [c.name for c in hosted.run.machine.channels if c.direction == "sensor" and not c.ros_type]
        if unmapped:
            node.get_logger().warning(f"nothing fills {', '.join(unmapped)}: a sensor channel needs `ros` in mode free")

    def activate(self) -> None:
        """Publishes the latched topics; the first deadline is now."""
        self._time.start()
        self._stamp_ns = self._time.at(time.monotonic_ns())
        self._hosted.run.record_time(self._stamp_ns)
        self._hosted.record()
        self._hosted.topics.publish_latched(self._stamp_ns)
        self._inputs.forget()
        gc.unfreeze()
        gc.collect()
        gc.freeze()  # the garbage collector ignores objects that exist now
        self._pacer.start(time.monotonic_ns())

    def run(self) -> None:
        """Ticks until `serve` raises."""
        while True:
            now = time.monotonic_ns()
            deadline = self._pacer.deadline_ns
            if deadline - now > self._roomy_ns or now > self._serve_by_ns:
                self._serve()
                self._diagnose()
                now = time.monotonic_ns()
                self._serve_by_ns = now + _SERVE_AT_LEAST_NS
            if now < deadline:
                sleep_until(min(deadline, now + _SLICE_NS))
            else:
                self._tick(now)

    def _tick(self, now_ns: int) -> None:
        hosted = self._hosted
        tick, deadline = hosted.run.tick, self._pacer.begin(now_ns)
        self._stamp_ns = self._time.at(deadline)
        hosted.run.record_time(self._stamp_ns)
        self._inputs.poll(self._time.at(now_ns), hosted.dropouts.missing())
        hosted.run.step(1)
        hosted.show(tick, self._stamp_ns)

    def _diagnose(self) -> None:
        """Once per second, in the slack."""
        if self._hosted.diagnostics.due():
            self._hosted.check_record()
            self._time.follow()
            self._hosted.diagnostics.publish(self._stamp_ns)

    def rest(self) -> None:
        """While inactive there is nothing to do."""

    def now_ns(self) -> int:
        """The time that a message of now is stamped with."""
        return self._time.at(time.monotonic_ns())

    def leave(self) -> None:
        """Nothing to do: no simulator waits for this node."""

    def figures(self) -> Figures:
        return {**self._pacer.figures(), **self._inputs.figures()}

    def troubles(self) -> dict[str, int]:
        own = {"deadlines missed": self._pacer.missed, "system clock set": self._time.sets}
        return {**own, **self._inputs.troubles()}

    def close(self) -> None:
        gc.unfreeze()
        self._inputs.close()
        self._time.close()
