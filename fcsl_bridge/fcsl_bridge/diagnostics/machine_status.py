# SPDX-License-Identifier: Apache-2.0
"""A machine's health for ROS 2's own tools: /diagnostics.

The machine's status is that of its worst instance; at least WARN while counts grow (missed deadlines, refused inputs,
dropped records, lost requests), and STALE while inactive. Each instance has a status: nominal OK, degraded WARN, failed
ERROR, stale (the active state does not schedule it) STALE; at least WARN if it faulted or overran since the previous
message. The requirements of the machine have one, too (requirement_status.py), and so have the times of its instances, if
it measures them (time_status.py).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Protocol

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from fcsl_msgs.msg import FaultCounters, InstanceHealth, MachineState
from simclient.c_machine import HEALTH_NAMES
from simclient.run import Run

from ..topics import qos
from .diagnostic_status import Figures, make_status
from .requirement_status import RequirementStatus
from .time_status import TimeStatus

_LEVELS = {
    InstanceHealth.NOMINAL: DiagnosticStatus.OK,
    InstanceHealth.DEGRADED: DiagnosticStatus.WARN,
    InstanceHealth.FAILED: DiagnosticStatus.ERROR,
    InstanceHealth.STALE: DiagnosticStatus.STALE,
}
_PERIOD_S = 1.0
#: Of ages in ticks, for all that are older.
_OLDEST = 2**32 - 1
_NS = 1_000_000_000


class Source(Protocol):
    """A source of figures for diagnostics.

    `troubles` are counts; a count that has grown makes the machine's status WARN.
    """

    def figures(self) -> Figures: ...

    def troubles(self) -> Mapping[str, int]: ...


class Diagnostics:
    """Publishes /diagnostics. `sources` may grow later."""

    def __init__(self, node: Node, run: Run, sources: Sequence[Source]):
        self._node, self._run, self._sources = node, run, sources
        self._publisher = qos.publisher(node, DiagnosticArray, "/diagnostics", qos.EVENT)
        self._name = f"{node.get_namespace().rstrip('/')}/{run.machine.name}"[1:]
        self._requirements = RequirementStatus(self._name, run.machine.name)
        self._times = TimeStatus(self._name, run.machine.name)
        self._before: dict[str, int] = {}
        self._published_s, self._active = 0.0, False

    def due(self, active: bool = True) -> bool:
        """Whether to publish now: once per second of wall time, and on a change."""
        return active != self._active or time.monotonic() - self._published_s >= _PERIOD_S

    def publish(self, time_ns: int, active: bool = True) -> None:
        """Publishes the status after the last tick, stamped time_ns. If not `active`, the machine is STALE."""
        self._published_s, self._active = time.monotonic(), active
        state = deserialize_message(self._run.tick_message("state"), MachineState)
        health = deserialize_message(self._run.tick_message("health"), InstanceHealth)
        counters = deserialize_message(self._run.tick_message("faults"), FaultCounters)
        statuses = [
            self._instance(name, level if active else InstanceHealth.STALE, faults, overruns, place)
            for name, level, faults, overruns, place in zip(
                health.instance, health.health, counters.faults, counters.overruns, counters.fault_place, strict=True
            )
        ]
        verdicts = self._run.verdicts()
        for line in self._requirements.begun(verdicts):
            self._node.get_logger().warning(f"requirement {line}")
        machine, requirements = self._machine(state, statuses, active), self._requirements.statuses(verdicts)
        times = self._times.statuses(self._run.times())
        message = DiagnosticArray(status=[machine, *statuses, *requirements, *times])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, _NS)
        self._publisher.publish(message)

    def _machine(self, state: MachineState, statuses: list[DiagnosticStatus], active: bool) -> DiagnosticStatus:
        troubles = {key: count for source in self._sources for key, count in source.troubles().items()}
        troubles |= {
            f"lost requests {name}": count for name, count in self._run.machine.lost_requests(self._run.read).items()
        }
        shown = {key: value for source in self._sources for key, value in source.figures().items()}
        grown = self._grown("", troubles)
        running = [s.level for s in statuses if s.level != DiagnosticStatus.STALE]
        level = max(running, default=DiagnosticStatus.STALE)
        if grown and active:
            level = max(level, DiagnosticStatus.WARN) if running else DiagnosticStatus.WARN
        figures: Figures = {
            "state": state.state,
            "tick": self._run.tick,
            "source hash": self._run.machine.source_hash,
            **shown,
            **troubles,
        }
        text = "; ".join([state.state if active else "inactive", *grown])
        return self._status(self._name, level, text, figures)

    def _instance(self, name: str, health: int, faults: int, overruns: int, fault_place: str) -> DiagnosticStatus:
        counts = {"faults": faults, "overruns": overruns}
        faulted = faults > self._before.get(f"{name} faults", 0)
        grown = self._grown(name, counts)
        if faulted:
            self._node.get_logger().warning(f"{name}: {'; '.join([*grown, fault_place])}")
        level = _LEVELS[health]
        if grown and level == DiagnosticStatus.OK:
            level = DiagnosticStatus.WARN
        words = [HEALTH_NAMES[health], *self._silent(name), *grown, *([fault_place] if faulted else [])]
        return self._status(f"{self._name}: {name}", level, "; ".join(words), {**counts, "fault place": fault_place})

    def _silent(self, instance: str) -> list[str]:
        """Texts about sensor channels of the instance without samples."""
        run, lacks = self._run, []
        for channel in run.machine.channels:
            if channel.direction == "sensor" and channel.field.instance == instance:
                valid, waiting, age = (
                    run.machine.fields[f"channels.{channel.name}.{what}"] for what in ("valid", "waiting", "age_ticks")
                )
                if not run.read(valid.offset, 1)[0]:
                    ticks = int.from_bytes(run.read(age.offset, age.size), sys.byteorder)
                    if run.read(waiting.offset, 1)[0]:
                        lacks.append(f"{channel.name}: waiting for its first sample, {ticks} ticks so far")
                    elif ticks == _OLDEST:
                        lacks.append(f"{channel.name}: its samples have stamps of another clock")
                    else:
                        lacks.append(f"{channel.name}: no sample for {ticks} ticks ({channel.max_age_ticks} allowed)")
        return lacks

    def _grown(self, whose: str, counts: Mapping[str, int]) -> list[str]:
        """Texts about counts that have grown since the last call."""
        grown = []
        for key, count in counts.items():
            more = count - self._before.get(f"{whose} {key}", 0)
            self._before[f"{whose} {key}"] = count
            if more > 0:
                grown.append(f"{more} {key}")
        return grown

    def _status(self, name: str, level: bytes, message: str, figures: Figures) -> DiagnosticStatus:
        return make_status(name, level, message, self._run.machine.name, figures)

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)
