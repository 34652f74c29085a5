# SPDX-License-Identifier: Apache-2.0
"""Progress and speed of a simulation, on the terminal and on /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from simclient.descriptor import Machine
from simclient.ros.publish_queue import PublishQueue

from ..diagnostics.diagnostic_status import Figures, make_status
from ..topics import qos
from .sim_control import Control
from .sim_vehicle import Vehicle

_PRINT_PERIOD_S = 2.0
_DIAGNOSTICS_PERIOD_S = 1.0
#: Fraction of the requested speed below which the status is WARN.
_KEPT = 0.9
_NS = 1_000_000_000


def verdict(control: Control, tick: int, factor: float) -> tuple[bytes, str]:
    """Level and text of a status; `factor`: simulated seconds per second."""
    if control.paused or not tick:
        return DiagnosticStatus.OK, "paused" if control.paused else "waiting"
    if factor < _KEPT * control.speed:
        return DiagnosticStatus.WARN, f"slower than the speed of {control.speed:g} that was asked for"
    return DiagnosticStatus.OK, "running"


class Progress:
    """Real time counts from the first tick of a run to the last answer, without the waits for the controller and for
    subscribers."""

    def __init__(self, node: Node, machine: Machine, queue: PublishQueue):
        self._queue = queue
        self._name, self._machine = node.get_fully_qualified_name()[1:], machine
        self._publisher = qos.publisher(node, DiagnosticArray, "/diagnostics", qos.EVENT)
        self._begun = self._printed = self._published = 0.0
        self._updated = time.perf_counter()
        self._tick = self._published_tick = 0

    def begin_run(self) -> None:
        """The next tick is tick 0."""
        self._begun = 0.0
        self._tick = self._published_tick = 0

    def update(self, tick: int, control: Control, vehicles: Sequence[Vehicle]) -> None:
        """Reports progress; call it often. `tick` ticks are completed."""
        now = time.perf_counter()
        if tick and not self._begun:
            self._begun, self._printed = self._updated, now  # the first ticks were made since the last call
        self._tick, self._updated = tick, now
        if now - self._printed > _PRINT_PERIOD_S and tick and not control.paused:
            self._printed = now
            at_s, end_s = self._time_s(tick), self._time_s(max(vehicle.sim.ticks for vehicle in vehicles))
            print(f"simulating: tick {tick}, {at_s:.1f} s of at most {end_s:.1f} s", flush=True)
        if now - self._published > _DIAGNOSTICS_PERIOD_S:
            self._publish(now, control, vehicles)

    def summary(self, what: str) -> str:
        """One line for the end of the run."""
        if not self._begun or self._tick < 2:
            return f"{what}: {self._tick} ticks answered"
        wall_s, time_s = self._updated - self._begun, self._time_s(self._tick)
        speed = f"{self._tick / wall_s:.0f} ticks/s, {time_s / wall_s:.1f} times real time"
        return f"{what}: {self._tick} ticks answered, {time_s:.3f} s of flight in {wall_s:.2f} s ({speed})"

    def _publish(self, now: float, control: Control, vehicles: Sequence[Vehicle]) -> None:
        flown_s = self._time_s(self._tick) - self._time_s(self._published_tick)
        factor = flown_s / (now - self._published) if self._published else 0.0
        self._published, self._published_tick = now, self._tick
        figures: Figures = {
            "real time factor": f"{factor:.3f}",
            "speed": control.speed,
            "tick": self._tick,
            "messages dropped": self._queue.dropped,
        }
        level, text = verdict(control, self._tick, factor)
        message = DiagnosticArray(status=[make_status(self._name, level, text, "simulation", figures)])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self._machine.time_ns(self._tick), _NS)
        self._publisher.publish(message)

    def _time_s(self, tick: int) -> float:
        return self._machine.time_ns(tick) / 1e9
