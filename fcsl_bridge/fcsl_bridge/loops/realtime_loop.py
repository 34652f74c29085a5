# SPDX-License-Identifier: Apache-2.0
"""Runs a machine in real time: one tick at each deadline of pacer.py, with the newest inputs.

Stamps are ROS time at the deadline of a tick (ros_time.py); a change of the system clock is detected within a second.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node

from ..base.polling import SERVE_PERIOD_S
from ..diagnostics.machine_status import Figures
from .clock_drift import ClockDrift
from .configured_machine import ConfiguredMachine
from .free_running import FreeRunning
from .pacer import Pacer, sleep_until

_NS = 1_000_000_000
_SLICE_NS = int(SERVE_PERIOD_S * _NS)
#: Callbacks run when half a period is left after a tick with little output, and at least this often.
_SERVE_AT_LEAST_NS = 5 * _SLICE_NS


class RealtimeLoop(FreeRunning):
    """On CLOCK_MONOTONIC; with use_sim_time (as set when the node was configured) /clock gives the stamps alone."""

    def __init__(
        self, node: Node, configured: ConfiguredMachine, serve: Callable[[], None], options: Mapping[str, Any]
    ):
        super().__init__(node, configured, serve, bool(node.get_parameter("use_sim_time").value))
        self._pacer = Pacer(configured.run.machine.tick_hz)
        self._drift = ClockDrift(node, configured.run.machine) if self._time.simulated else None
        self._roomy_ns = _NS // configured.run.machine.tick_hz // 2
        self._serve_by_ns = 0

    def _start(self) -> None:
        if self._drift is not None:
            self._drift.start()
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
                self._tick(self._time.at(self._pacer.begin(now)), self._time.at(now))

    def _diagnose(self) -> None:
        if self._drift is not None:
            self._drift.check(self._configured.run.tick, self._stamp_ns)
        super()._diagnose()

    def figures(self) -> Figures:
        return {**self._pacer.figures(), **super().figures()}

    def troubles(self) -> dict[str, int]:
        drift = {} if self._drift is None else {"times /clock and ticks parted": self._drift.times}
        return {"deadlines missed": self._pacer.missed, **drift, **super().troubles()}
