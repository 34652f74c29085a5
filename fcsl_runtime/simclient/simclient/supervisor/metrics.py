# SPDX-License-Identifier: Apache-2.0
"""Metrics for Prometheus: text format 0.0.4, with counters, histograms and healths of all runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..vars.wire import VarError
from . import run_status
from .http_error import HttpError
from .runs import STATUSES, Run

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"

#: Member of `stats`, name, help text.
_COUNTERS = (
    ("tick", "ticks", "Ticks completed since the beginning of the run (or of the run whose checkpoint it began with)."),
    ("late", "late", "Deadlines that the loop reached at the next one or later."),
    ("skipped", "skipped", "Deadlines without a tick."),
    ("stuck", "stuck", "Ticks that the watchdog reported."),
    ("faults", "faults", "Faults of all instances."),
    ("overruns", "overruns", "Executes that took longer than max_wcet_us, of all instances."),
    ("hardware_failures", "hardware_failures", "Calls of hardware that failed."),
    ("frames_refused", "frames_refused", "Sensor frames refused."),
    ("records_dropped", "records_dropped", "Ticks missing in the recording."),
    ("requests", "requests", "Requests that the variable server received."),
    ("requests_refused", "requests_refused", "Requests that the variable server refused."),
    ("clients_dropped", "clients_dropped", "Clients that the variable server dropped."),
    ("samples_lost", "samples_lost", "Samples that subscriptions lost."),
)
_HISTOGRAMS = (
    ("lateness_ns", "lateness_seconds", "Time from a deadline until the loop reached it."),
    ("step_time_ns", "step_time_seconds", "Time from the sensors' sample to the end of the tick's work."),
)
#: Buckets end at 2^N - 1 ns: these are also bounds of the program's finer buckets, so counts are exact.
_POWERS = range(8, 35)
#: Member of the receiver's counts, whether it is a counter (only rises), help text.
_TELEMETRY = (
    ("received", True, "Datagrams received."),
    ("malformed", True, "Datagrams that are not telemetry, or damaged."),
    ("configurations", True, "Datagrams of configurations."),
    ("accepted", True, "Data datagrams, each counted once."),
    ("duplicated", True, "Datagrams received before."),
    ("late", True, "Datagrams too old for the window."),
    ("other_session", True, "Datagrams of another session."),
    ("before_configuration", True, "Datagrams dropped before any configuration."),
    ("waiting", False, "Datagrams that wait for their configuration."),
    ("packets", True, "Complete data packets."),
    ("reordered", True, "Packets received after a later one."),
    ("lost", False, "Missing packets; a packet that arrives late is subtracted."),
    ("incomplete", False, "Packets of which some datagrams are missing."),
    ("missed", False, "Ticks that the sender itself missed in this session."),
    ("sessions", True, "Sessions received: 1, and one more for every restart of the sender."),
)


@dataclasses.dataclass(frozen=True)
class Seen:
    """A run at one moment; `stats` is empty if it does not serve its variables."""

    run: Run
    status: str
    health: Mapping[str, Any]
    stats: Mapping[str, Any]


def see(run: Run) -> Seen:
    """Queries the run. Never raises."""
    health = run_status.health(run)
    status = run.status  # read after the query, since the run may end meanwhile
    stats: Mapping[str, Any] = {}
    if "tick" in health:  # the run answered
        try:
            with run_status.client_of(run) as client:
                stats = client.stats()
        except (HttpError, VarError):
            pass
    return Seen(run, status, health, stats)


def text(seen: Sequence[Seen]) -> str:
    """The whole text."""
    lines: list[str] = []
    _family(lines, "runs", "gauge", "Runs by status.", _runs(seen))
    _family(
        lines, "run_up", "gauge", "1: the run is running and answers.", ((s, "", {}, int(bool(s.stats))) for s in seen)
    )
    healths: Iterable[_Row] = (
        (s, "", {}, run_status.worst_number(s.health["health"])) for s in seen if s.status != "ended"
    )
    help_text = "Worst health: 0 nominal, 1 stale, 2 degraded, 3 failed, 4 stuck, silent, starting or stopping."
    _family(lines, "run_health", "gauge", help_text, healths)
    _family(lines, "run_paused", "gauge", "1: the run is paused.", _members(seen, "paused"))
    for member, name, what in _COUNTERS:
        _family(lines, f"run_{name}_total", "counter", what, _members(seen, member))
    for member, name, what in _HISTOGRAMS:
        samples = [row for s in seen if member in s.stats for row in _histogram(s, s.stats[member])]
        _family(lines, f"run_{name}", "histogram", what, samples)
    received = [(s, s.run.telemetry.counts) for s in seen if s.status != "ended"]
    for name, rises, what in _TELEMETRY:
        counts: Iterable[_Row] = ((s, "", {}, getattr(found, name)) for s, found in received)
        full = f"run_telemetry_{name}{'_total' if rises else ''}"
        _family(lines, full, "counter" if rises else "gauge", what, counts)
    return "".join(lines)


#: A run (None: the service), suffix of the name, labels, value.
_Row = tuple[Seen | None, str, Mapping[str, str], float]


def _family(lines: list[str], name: str, kind: str, what: str, rows: Iterable[_Row]) -> None:
    lines.append(f"# HELP fcsl_{name} {what}\n# TYPE fcsl_{name} {kind}\n")
    for seen, end, more, value in rows:
        labels = {**({} if seen is None else {"run": seen.run.name, "kind": seen.run.kind}), **more}
        shown = ",".join(f'{key}="{_escaped(label)}"' for key, label in labels.items())
        lines.append(f"fcsl_{name}{end}{{{shown}}} {value!r}\n")


def _escaped(label: str) -> str:
    return label.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _runs(seen: Sequence[Seen]) -> Iterable[_Row]:
    return ((None, "", {"status": status}, sum(s.status == status for s in seen)) for status in STATUSES)


def _members(seen: Sequence[Seen], member: str) -> Iterable[_Row]:
    return ((s, "", {}, int(s.stats[member])) for s in seen if member in s.stats)


def _histogram(seen: Seen, times: Mapping[str, Any]) -> list[_Row]:
    """Cumulative counts by powers of two. The sum uses each bucket's upper bound: at most 1/32 too large."""
    buckets: Sequence[Sequence[int]] = times["buckets"]
    rows: list[_Row] = []
    for power in _POWERS:
        end = (1 << power) - 1
        below = sum(count for last, count in buckets if last <= end)
        rows.append((seen, "_bucket", {"le": repr(end / 1e9)}, below))
    total = sum(count for _, count in buckets)
    nanoseconds = sum(min(last, times["max"]) * count for last, count in buckets)
    return [
        *rows,
        (seen, "_bucket", {"le": "+Inf"}, total),
        (seen, "_sum", {}, nanoseconds / 1e9),
        (seen, "_count", {}, total),
    ]
