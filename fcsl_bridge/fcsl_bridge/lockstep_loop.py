# SPDX-License-Identifier: Apache-2.0
"""Runs a machine that a simulator steps: only the sensor bundle of tick k causes tick k (lockstep.py).

Stamps are the machine's time t_k. While the node is inactive simulated time stands still: the simulator's bundle waits.
A new run of the simulator restarts the machine, with the node's current parameters, into a new bag.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from simclient.errors import TwinError

from .diagnostics import Figures
from .errors import BridgeError
from .hosted import Hosted
from .lockstep import ControllerEnd, Sensors, Silence


class LockstepLoop:
    """`serve` runs the node's other callbacks, and raises what ends the ticking."""

    def __init__(self, node: Node, hosted: Hosted, serve: Callable[[], None], options: Mapping[str, Any]):
        self._hosted, self._serve_node = hosted, serve
        self._end = ControllerEnd(node, hosted.run.machine, self._serve)
        self._start_timeout_s, self._timeout_s = options["start_timeout_s"], options["timeout_s"]
        self._next_timeout_s = self._start_timeout_s
        self._running = False
        hosted.sources.append(self)

    def activate(self) -> None:
        """Publishes the latched topics; ticks follow the simulator's bundles."""
        run = self._hosted.run
        self._hosted.topics.publish_latched(run.machine.time_ns(max(run.tick - 1, 0)))
        if run.tick == 0 or self._running:  # otherwise the next tick starts over, and begins a bag
            self._hosted.record()
        if not self._running:
            self._next_timeout_s = self._start_timeout_s
            print(f"{run.machine.name}: waiting for a simulator", flush=True)

    def run(self) -> None:
        """Ticks until the simulator ends the run. Raises BridgeError, which names the missing tick, and the errors of
        `serve`."""
        hosted, run = self._hosted, self._hosted.run
        while (sensors := self._next()) is not None:
            self._running = True
            if sensors.first and run.tick != 0:
                hosted.start_over()
            try:
                run.sense(hosted.dropouts.strip(sensors.message))
            except TwinError as error:
                raise BridgeError(f"tick {sensors.tick}: {error}") from None
            run.step(1)
            self._end.answer(run.actuate())  # first, so that the simulator continues meanwhile
            hosted.show(sensors.tick, run.machine.time_ns(sensors.tick))
            self._next_timeout_s = self._timeout_s
        self._running = False

    def _next(self) -> Sensors | None:
        try:
            return self._end.next(self._next_timeout_s)
        except Silence:
            self._running = False  # there is no simulator to leave
            raise

    def _serve(self) -> None:
        """Runs at every tick, and often while waiting for the simulator."""
        self._serve_node()
        diagnostics, run = self._hosted.diagnostics, self._hosted.run
        if diagnostics.due():
            diagnostics.publish(run.machine.time_ns(max(run.tick - 1, 0)))

    def rest(self) -> None:
        """While inactive: keeps the simulator waiting."""
        self._end.alive()

    def now_ns(self) -> int:
        """The time that a message of now is stamped with: that of the coming tick."""
        return self._hosted.run.machine.time_ns(self._hosted.run.tick)

    def leave(self) -> None:
        """Makes a running simulator end at once instead of waiting for an answer."""
        if self._running:
            self._end.leave()

    def figures(self) -> Figures:
        return {"hal.repeated bundles": self._end.dropped}

    def troubles(self) -> dict[str, int]:
        return {}

    def close(self) -> None:
        self._end.close()
