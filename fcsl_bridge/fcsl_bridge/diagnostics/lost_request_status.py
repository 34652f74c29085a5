# SPDX-License-Identifier: Apache-2.0
"""Requests that transitions of a flight have lost to others, as the status of its machine on /diagnostics.

There is no status before the first loss. It is WARN if requests were lost since the previous look, OK otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus

from .diagnostic_status import make_status


class LostRequestStatus:
    """Of one flight of this machine; the status is called `name`."""

    def __init__(self, name: str, machine: str):
        self._name, self._machine = name, machine
        self._before: Mapping[str, int] | None = None

    def statuses(self, state: str, lost: Mapping[str, int]) -> list[DiagnosticStatus]:
        """`lost`: by transition, without the zeros. What was lost before the first look is old."""
        before = lost if self._before is None else self._before
        self._before = lost
        if not lost:
            return []
        more = {name: count - before.get(name, 0) for name, count in lost.items()}
        grown = [f"{count} lost requests {name}" for name, count in more.items() if count > 0]
        level = DiagnosticStatus.WARN if grown else DiagnosticStatus.OK
        figures = {f"lost requests {name}": count for name, count in lost.items()}
        return [make_status(self._name, level, "; ".join([state, *grown]), self._machine, figures)]
