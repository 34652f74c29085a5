# SPDX-License-Identifier: Apache-2.0
"""How long the instances of a measured machine take, as a status on /diagnostics. It is OK: a limit is max_wcet_us."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus

from simclient.instance_times import STEP, InstanceTime

from .diagnostic_status import Figures, make_status


class TimeStatus:
    """Of one machine; `name` is that of its status."""

    def __init__(self, name: str, machine: str):
        self._name, self._machine = f"{name}: times", machine

    def statuses(self, times: Mapping[str, InstanceTime]) -> list[DiagnosticStatus]:
        """None if the machine is not measured."""
        instances = {instance: row for instance, row in times.items() if instance != STEP}
        if not instances:
            return []
        longest = max(instances, key=lambda instance: instances[instance].total_ns)
        text = f"{longest} takes {100 * instances[longest].share:.1f} % of the step"
        figures = {key: value for instance, row in times.items() for key, value in _figures(instance, row).items()}
        return [make_status(self._name, DiagnosticStatus.OK, text, self._machine, figures)]


def _figures(instance: str, row: InstanceTime) -> Figures:
    return {
        f"{instance} runs": row.runs,
        f"{instance} share": round(row.share, 4),
        f"{instance} mean us": row.mean_ns / 1000,
        f"{instance} p99 us": row.p99_ns / 1000,
        f"{instance} max us": row.max_ns / 1000,
    }
