# SPDX-License-Identifier: Apache-2.0
"""The requirements of a machine as a status on /diagnostics.

ERROR while one is violated, WARN once one was, OK otherwise. Each has a value: its verdict. Violated assumptions are the
environment's: WARN at most.
"""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from simclient.requirements import Status, Verdict

from .diagnostic_status import make_status


class RequirementStatus:
    """Of one machine; `name` is that of its status."""

    def __init__(self, name: str, machine: str):
        self._name, self._machine = f"{name}: requirements", machine
        self._before: dict[str, int] = {}

    def statuses(self, verdicts: Sequence[Verdict]) -> list[DiagnosticStatus]:
        """None without requirements. `at_end` is of a run that has ended, and this one goes on."""
        judged = [verdict for verdict in verdicts if verdict.kind != "at_end"]
        if not judged:
            return []
        violated = [v for v in judged if v.status is Status.VIOLATED]
        now = [v for v in violated if not v.holds and not v.assumed]
        level = DiagnosticStatus.ERROR if now else DiagnosticStatus.WARN if violated else DiagnosticStatus.OK
        met = sum(v.status is Status.MET for v in judged)
        words = "; ".join(map(str, violated)) if violated else f"{met} of {len(judged)} met so far"
        return [make_status(self._name, level, words, self._machine, {v.id: str(v.status) for v in judged})]

    def begun(self, verdicts: Sequence[Verdict]) -> list[str]:
        """The lines of those that have been violated again since the last call."""
        lines = [str(v) for v in verdicts if v.violations > self._before.get(v.id, 0)]
        self._before = {v.id: v.violations for v in verdicts}
        return lines
