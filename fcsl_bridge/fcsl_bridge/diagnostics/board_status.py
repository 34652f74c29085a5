# SPDX-License-Identifier: Apache-2.0
"""The sensors and devices of a board as statuses of /diagnostics.

A sensor is OK while its first device is primary and all its devices are healthy, ERROR while it has no primary, WARN
otherwise. A device is ERROR while it is not there, WARN while it is silent and if reads failed, samples were dropped,
bytes were rejected or it was lost since the previous look, OK otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus

from simclient.board.frontends import CONDITIONS
from simclient.board.native import why_text

from .diagnostic_status import make_status

#: Counts of a device that may not grow, and how they are called.
_TROUBLES = {"errors": "errors", "dropped": "dropped", "lost": "lost", "rejected": "bytes rejected"}
Counts = dict[str, int]


class BoardStatus:
    """Of one flight of this machine; statuses begin with `name`."""

    def __init__(self, name: str, machine: str):
        self._name, self._machine = name, machine
        self._before: dict[str, Counts] = {}

    def statuses(self, counters: Mapping[str, int]) -> list[DiagnosticStatus]:
        """`counters`: the variables under `hal.` (docs/hardware/hal.md), and beside them those of a simulator's wire."""
        found: dict[str, dict[str, Counts]] = {"sensors": {}, "devices": {}}
        for path, value in counters.items():
            group, _, rest = path.partition(".")
            owner, _, figure = rest.partition(".")
            if group in found:
                found[group].setdefault(owner, {})[figure] = value
        sensors = [self._sensor(name, counts) for name, counts in found["sensors"].items()]
        return sensors + [self._device(name, counts) for name, counts in found["devices"].items()]

    def _sensor(self, name: str, counts: Counts) -> DiagnosticStatus:
        conditions = {path.partition(".")[2]: CONDITIONS[n] for path, n in counts.items() if path != "primary"}
        primary = ["none", *conditions][counts["primary"]]
        ill = [f"{device} {condition}" for device, condition in conditions.items() if condition != CONDITIONS[0]]
        level = DiagnosticStatus.WARN if ill or counts["primary"] != 1 else DiagnosticStatus.OK
        if not counts["primary"]:
            level = DiagnosticStatus.ERROR
        figures = {"primary": primary, **{f"condition.{device}": text for device, text in conditions.items()}}
        text = "; ".join([f"primary {primary}", *ill])
        return make_status(f"{self._name}: sensor {name}", level, text, self._machine, figures)

    def _device(self, name: str, counts: Counts) -> DiagnosticStatus:
        before = self._before.get(name, counts)
        self._before[name] = counts
        grown = [f"{counts[key] - before[key]} {text}" for key, text in _TROUBLES.items() if counts[key] > before[key]]
        why = why_text(counts["why"])
        level = DiagnosticStatus.WARN if grown or why else DiagnosticStatus.OK
        if not counts["open"]:
            level = DiagnosticStatus.ERROR
        silence = [f"silent: {why}"] if why else []
        text = "; ".join(["there" if counts["open"] else "not there", *silence, *grown])
        return make_status(f"{self._name}: device {name}", level, text, self._machine, {**counts, "why": why})
