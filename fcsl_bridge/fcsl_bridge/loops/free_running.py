# SPDX-License-Identifier: Apache-2.0
"""What running on a robot's topics has in common, whatever makes a tick due: realtime_loop.py, clock_loop.py.

The thread that steps does all other work in the slack between ticks; no callback causes a tick. Stamps are ROS time, in
topics and in the bag. Tick numbers count steps: a tick that was skipped is none.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable

from rclpy.node import Node

from ..diagnostics.machine_status import Figures
from ..topics.mapped_services import Services
from ..topics.mapped_topics import Inputs
from .configured_machine import ConfiguredMachine
from .ros_time import RosTime

#: Without a message of /clock for so long after the start a node says what it lacks, in s.
_NO_CLOCK_S = 2.0


class FreeRunning:
    """`serve` runs the node's other callbacks, and raises what ends the ticking. `simulated`: ROS time is that of /clock."""

    #: What a node without /clock cannot do.
    _LACKS = "with use_sim_time all stamps are 0 until a simulator or `ros2 bag play --clock` publishes it"

    def __init__(self, node: Node, configured: ConfiguredMachine, serve: Callable[[], None], simulated: bool):
        self._node, self._configured, self._serve = node, configured, serve
        self._inputs = Inputs(node, configured.run)
        self._services = Services(node, configured.run)
        self._time = RosTime(node, simulated)
        self._stamp_ns = 0
        self._clockless_at_s = 0.0
        configured.sources.append(self)
        configured.run.time_executes()
        machine = configured.run.machine
        called = {service.channel for service in machine.services}
        sensors = [c for c in machine.channels if c.direction == "sensor" and c.index not in called]
        unmapped = [c.name for c in sensors if not c.ros_type]
        if unmapped:
            node.get_logger().warning(
                f"nothing fills {', '.join(unmapped)}: outside lock-step a sensor channel needs `ros`"
            )

    def activate(self) -> None:
        """Publishes the latched topics; ticks become due from now on."""
        self._time.start()
        self._stamp_ns = self.now_ns()
        self._configured.run.record_time(self._stamp_ns)
        self._configured.record()
        self._configured.show_changes(self._stamp_ns)
        self._clockless_at_s = time.monotonic() + _NO_CLOCK_S
        self._inputs.forget()
        self._services.begin(self._stamp_ns)
        gc.unfreeze()
        gc.collect()
        gc.freeze()  # the garbage collector ignores objects that exist now
        self._start()

    def _start(self) -> None:
        """The first tick is due now, or with what makes ticks due."""
        raise NotImplementedError

    def _tick(self, stamp_ns: int, now_ns: int) -> None:
        """Makes the tick that was due at stamp_ns, with what came until now_ns; both in ROS time."""
        configured, self._stamp_ns = self._configured, stamp_ns
        configured.run.record_time(stamp_ns)
        missing = configured.dropouts.missing()
        self._inputs.poll(now_ns, missing)
        self._services.take(now_ns, missing)
        configured.run.step(1)
        configured.show(stamp_ns)
        self._services.answer()

    def _diagnose(self) -> None:
        """Once per second, in the slack."""
        if self._configured.diagnostics.due():
            self._configured.check_record()
            self._time.follow()
            if self.now_ns() > 0:
                self._inputs.warn_of_other_clocks("/clock" if self._time.simulated else "the system's clock")
            self._warn_of_no_clock()
            self._configured.diagnostics.publish(self._stamp_ns)

    def _warn_of_no_clock(self) -> None:
        """Logs once after each start."""
        if self._time.simulated and not self._time.received and time.monotonic() >= self._clockless_at_s:
            self._clockless_at_s = math.inf
            self._node.get_logger().warning(f"no message of /clock has come within {_NO_CLOCK_S:g} s: {self._LACKS}")

    def rest(self) -> None:
        """While inactive."""
        self._services.refuse()

    def now_ns(self) -> int:
        """The time that a message of now is stamped with."""
        return self._time.at(time.monotonic_ns())

    def leave(self) -> None:
        """Nothing to do: no simulator waits for this node."""

    def figures(self) -> Figures:
        return self._inputs.figures()

    def troubles(self) -> dict[str, int]:
        return {
            "system clock set": self._time.sets,
            "/clock malformed": self._time.malformed,
            **self._inputs.troubles(),
        }

    def close(self) -> None:
        gc.unfreeze()
        self._services.refuse()
        self._services.close()
        self._inputs.close()
        self._time.close()
