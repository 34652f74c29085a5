# SPDX-License-Identifier: Apache-2.0
"""Runs a machine that a simulator steps over the bus: only the commit of tick k causes tick k (docs/reference/transports.md).

Native code makes the ticks, in slices; in between, the node serves its callbacks, which may write into the machine. Stamps
are the machine's time t_k. While the node is inactive simulated time stands still: the simulator is told that this end is
alive. A new run of the simulator restarts the machine, with the node's current parameters, into a new bag.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from simclient.ros.lockstep import Lockstep

from ..base.bus_address import endpoint, peer_address
from ..diagnostics.machine_status import Figures
from ..errors import BridgeError
from ..topics.queue_publisher import NativeThread
from .configured_machine import ConfiguredMachine

#: How long native code runs before the node's callbacks are served, in ms.
SLICE_MS = 50
#: How long it looks for a simulator before that.
_POLL_MS = 500
#: What the HAL counts, and means trouble (docs/hardware/hal.md).
_TROUBLES = ("messages_dropped", "messages_late", "bus.wrong_size", "bus.strays", "bus.overflowed", "wire.too_large")


class LockstepLoop:
    """`serve` runs the node's other callbacks, and raises what ends the ticking."""

    def __init__(
        self, node: Node, configured: ConfiguredMachine, serve: Callable[[], None], options: Mapping[str, Any]
    ):
        self._node, self._configured, self._serve_node = node, configured, serve
        self._endpoint = endpoint(options["bus"])
        where = (peer_address(self._endpoint, node.get_namespace()), node.get_namespace())
        self._lockstep = Lockstep(configured.run, configured.messages, configured.queue_publisher.queue, *where)
        self._native = NativeThread(configured.queue_publisher)
        self._start_timeout_s, self._timeout_s = options["start_timeout_s"], options["timeout_s"]
        self._timeout_ms = int(1000 * self._timeout_s)
        self._running = False
        self._lost = ""  # why the simulator before is gone
        configured.sources.append(self)

    def activate(self) -> None:
        """Publishes the latched topics; ticks follow the simulator's commits."""
        configured, run = self._configured, self._configured.run
        configured.show_changes(run.machine.time_ns(max(run.tick - 1, 0)))
        if run.tick == 0 or self._running:  # otherwise the next tick starts over, and begins a bag
            configured.record()
        if not self._running:
            print(f"{run.machine.name}: waiting for a simulator on {self._endpoint}", flush=True)

    def run(self) -> None:
        """Ticks until the simulator ends the run. Raises BridgeError, TwinError, and the errors of `serve`."""
        status = "running"
        while status != "ended":
            if not self._running:
                self._meet()
            self._serve()
            self._drop()
            self._running = False
            status = self._native(self._lockstep.run, SLICE_MS)
            self._running = status == "running"
            if status == "gone":
                self._disconnected()
        self._configured.queue_publisher.all()

    def _disconnected(self) -> None:
        """Another simulator may take the place of this one: it begins a new run."""
        self._lost = self._lockstep.problem
        self._node.get_logger().warning(f"{self._lost}; waiting for another one for {self._timeout_s} s")

    def _meet(self) -> None:
        """Waits for a simulator, and for its new run."""
        limit_s = self._timeout_s if self._lost else self._start_timeout_s
        deadline = time.monotonic() + limit_s
        while not self._native(self._lockstep.connect, _POLL_MS, self._timeout_ms):
            if time.monotonic() > deadline:
                raise BridgeError(self._lost or f"no simulator within {limit_s} s: {self._lockstep.problem}")
            self._serve()
        if self._configured.run.tick != 0:
            self._configured.start_over()
            self._lockstep.drop_none()
        self._running, self._lost = True, ""

    def _drop(self) -> None:
        for channel, ticks in self._configured.dropouts.take():
            self._lockstep.drop(channel, ticks)

    def _serve(self) -> None:
        self._serve_node()
        diagnostics, run = self._configured.diagnostics, self._configured.run
        if diagnostics.due():
            diagnostics.publish(run.machine.time_ns(max(run.tick - 1, 0)))

    def rest(self) -> None:
        """While inactive: keeps the simulator waiting."""
        self._lockstep.keep_alive()

    def now_ns(self) -> int:
        """The time that a message of now is stamped with: that of the coming tick."""
        return self._configured.run.machine.time_ns(self._configured.run.tick)

    def leave(self) -> None:
        """Makes a running simulator end at once instead of waiting for an answer."""
        self._lockstep.leave()

    def figures(self) -> Figures:
        return {}

    def troubles(self) -> dict[str, int]:
        return {f"hal.{path}": self._lockstep.count(path) for path in _TROUBLES}

    def close(self) -> None:
        self._native.close()
        self._lockstep.close()
