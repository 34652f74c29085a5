# SPDX-License-Identifier: Apache-2.0
"""A machine's health for ROS 2's own tools: /diagnostics, once per second of simulated time."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from fcsl_msgs.msg import FaultCounters, InstanceHealth, MachineState
from simclient.descriptor import HEALTH_NAMES
from simclient.run import Run

from . import qos

#: A stale instance is one that the active state does not schedule: nothing is wrong with it.
_LEVELS = {
    InstanceHealth.NOMINAL: DiagnosticStatus.OK,
    InstanceHealth.DEGRADED: DiagnosticStatus.WARN,
    InstanceHealth.FAILED: DiagnosticStatus.ERROR,
    InstanceHealth.STALE: DiagnosticStatus.OK,
}


class Diagnostics:
    """One status for the machine, as bad as its worst instance, and one per instance."""

    def __init__(self, node: Node, run: Run):
        self._run = run
        self._publisher = qos.publisher(node, DiagnosticArray, "/diagnostics", qos.EVENT)
        self._name = f"{node.get_namespace().rstrip('/')}/{run.machine.name}"[1:]

    def publish(self, tick: int) -> None:
        """At the ticks that begin a second of simulated time; `tick` is the last completed one."""
        if tick % self._run.machine.tick_hz:
            return
        state = deserialize_message(self._run.telemetry("state"), MachineState)
        health = deserialize_message(self._run.telemetry("health"), InstanceHealth)
        counters = deserialize_message(self._run.telemetry("faults"), FaultCounters)
        statuses = [
            self._status(f"{self._name}: {name}", _LEVELS[level], HEALTH_NAMES[level], faults=faults, overruns=overruns)
            for name, level, faults, overruns in zip(
                health.instance, health.health, counters.faults, counters.overruns, strict=True
            )
        ]
        worst = max(status.level for status in statuses)
        machine = self._status(self._name, worst, state.state, tick=tick, dropped=self._run.record_dropped())
        self._publisher.publish(DiagnosticArray(header=state.header, status=[machine, *statuses]))

    def _status(self, name: str, level: bytes, message: str, **values: int) -> DiagnosticStatus:
        pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        return DiagnosticStatus(
            name=name, level=level, message=message, hardware_id=self._run.machine.name, values=pairs
        )
