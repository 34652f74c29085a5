# SPDX-License-Identifier: Apache-2.0
"""Runs a machine on /clock: a message of it makes the ticks due whose time has come (clock_ticks.py).

So every tick stands for one period of that clock, however fast it runs: a bag at 3 times real time, Gazebo at 0.7. A tick
is stamped with the time at which it was due. All ticks that one message makes due find the sensors' newest messages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from ..base.polling import SERVE_PERIOD_S
from .clock_ticks import ClockTicks
from .configured_machine import ConfiguredMachine
from .free_running import FreeRunning


class ClockLoop(FreeRunning):
    """Before the first message of /clock there is no tick."""

    _LACKS = "with mode clock there is no tick until a simulator or `ros2 bag play --clock` publishes it"

    def __init__(
        self, node: Node, configured: ConfiguredMachine, serve: Callable[[], None], options: Mapping[str, Any]
    ):
        super().__init__(node, configured, serve, simulated=True)
        self._ticks = ClockTicks(configured.run.machine.tick_hz, options["max_ticks_per_clock"])
        self._received = 0  # messages of /clock whose ticks were made

    def _start(self) -> None:
        self._ticks.start()
        self._received = self._time.received

    def run(self) -> None:
        """Ticks until `serve` raises."""
        while True:
            self._serve()
            self._diagnose()
            self._time.wait(SERVE_PERIOD_S)
            now_ns = self.now_ns()
            if self._time.received != self._received:  # also those that were taken while diagnostics asked for the time
                self._received = self._time.received
                for due_ns in self._ticks.until(now_ns):
                    self._tick(due_ns, now_ns)

    def troubles(self) -> dict[str, int]:
        ticks = {"ticks skipped": self._ticks.skipped, "/clock set back": self._ticks.set_back}
        return {**ticks, **super().troubles()}
