# SPDX-License-Identifier: Apache-2.0
"""Metrics of all runs for Prometheus: counters, histograms and healths."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from ..vars.wire import VarError
from . import run_status
from .http_error import HttpError
from .runs import STATUSES, Run
from .stream import Streams

CONTENT_TYPE = CONTENT_TYPE_PLAIN_0_0_4
_RUN_LABELS = ("run", "kind")

#: Member of `stats`, name, help text.
_COUNTERS = (
    (
        "ticks",
        "ticks",
        "Ticks completed since the beginning of the run (or of the run whose checkpoint it began with).",
    ),
    ("deadlines_missed", "deadlines_missed", "Deadlines that the loop reached at the next one or later."),
    ("ticks_skipped", "ticks_skipped", "Deadlines without a tick."),
    ("watchdog_trips", "watchdog_trips", "Ticks that the watchdog reported."),
    ("faults", "faults", "Faults of all instances."),
    ("overruns", "overruns", "Executes that took longer than max_wcet_us, of all instances."),
    ("hardware_failures", "hardware_failures", "Calls of hardware that failed."),
    ("messages_refused", "messages_refused", "Sensor messages refused."),
    ("records_dropped", "records_dropped", "Ticks missing in the recording."),
    ("requests", "requests", "Requests that the variable server received."),
    ("requests_refused", "requests_refused", "Requests that the variable server refused."),
    ("clients_dropped", "clients_dropped", "Clients that the variable server dropped."),
    ("samples_lost", "samples_lost", "Samples that subscriptions lost."),
)
_HISTOGRAMS = (
    ("lateness_ns", "lateness_seconds", "Time from a deadline until the loop reached it."),
    ("tick_time_ns", "tick_time_seconds", "Time from the sensors' sample to the end of the tick's work."),
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
    ("too_old", True, "Datagrams too old for the window."),
    ("other_session", True, "Datagrams of another session."),
    ("before_configuration", True, "Datagrams dropped before any configuration."),
    ("waiting", False, "Datagrams that wait for their configuration."),
    ("packets", True, "Complete data packets."),
    ("reordered", True, "Packets received after a later one."),
    ("lost", False, "Missing packets; a packet that arrives late is subtracted."),
    ("incomplete", False, "Packets of which some datagrams are missing."),
    ("overwritten", False, "Packets that the sender never made in this session: its history was overwritten first."),
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


def text(seen: Sequence[Seen], streams: Streams) -> bytes:
    """The page, in Prometheus' text format."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Families(seen, streams))
    return generate_latest(registry)


class _Families(Collector):
    def __init__(self, seen: Sequence[Seen], streams: Streams):
        self._seen, self._streams = seen, streams

    def collect(self) -> Iterator[Metric]:
        runs = GaugeMetricFamily("fcsl_runs", "Runs by status.", labels=("status",))
        for status in STATUSES:
            runs.add_metric((status,), sum(s.status == status for s in self._seen))
        yield runs
        yield GaugeMetricFamily("fcsl_streams", "Open streams.", self._streams.open)
        dropped = "Streams whose readers took nothing, and were dropped."
        yield CounterMetricFamily("fcsl_streams_dropped", dropped, self._streams.dropped)
        live = [s for s in self._seen if s.status != "ended"]
        serving = [s for s in self._seen if s.stats]
        yield _gauge("up", "1: the run is running and answers.", ((s, bool(s.stats)) for s in self._seen))
        worst = ((s, run_status.worst_number(s.health["health"])) for s in live)
        help_text = (
            "Worst health: 0 nominal, 1 degraded, 2 failed, 3 stale, 4 stalled, unresponsive, starting or stopping."
        )
        yield _gauge("health", help_text, worst)
        yield _gauge("paused", "1: the run is paused.", ((s, s.stats["paused"]) for s in serving))
        yield _gauge("tick", "Ticks completed since tick 0.", ((s, s.stats["tick"]) for s in serving))
        for member, name, what in _COUNTERS:
            yield _counter(name, what, ((s, s.stats[member]) for s in serving if member in s.stats))
        yield _lost_requests(serving)
        yield _violations(serving)
        yield from _times(serving)
        for member, name, what in _HISTOGRAMS:
            yield _histogram(name, what, ((s, s.stats[member]) for s in serving if member in s.stats))
        received = [(s, s.run.telemetry.counts) for s in live]
        for name, rises, what in _TELEMETRY:
            family = _counter if rises else _gauge
            yield family(f"telemetry_{name}", what, ((s, getattr(counts, name)) for s, counts in received))


def _labels(seen: Seen) -> tuple[str, str]:
    return seen.run.name, seen.run.kind


def _gauge(name: str, what: str, rows: Iterable[tuple[Seen, float]]) -> Metric:
    family = GaugeMetricFamily(f"fcsl_run_{name}", what, labels=_RUN_LABELS)
    for seen, value in rows:
        family.add_metric(_labels(seen), value)
    return family


def _counter(name: str, what: str, rows: Iterable[tuple[Seen, float]]) -> Metric:
    family = CounterMetricFamily(f"fcsl_run_{name}", what, labels=_RUN_LABELS)
    for seen, value in rows:
        family.add_metric(_labels(seen), value)
    return family


def _lost_requests(serving: Iterable[Seen]) -> Metric:
    what = "Requests of a transition that lost to another transition, where some were lost."
    family = CounterMetricFamily("fcsl_run_lost_requests", what, labels=(*_RUN_LABELS, "transition"))
    for seen in serving:
        for transition, count in seen.stats.get("lost_requests", {}).items():
            family.add_metric((*_labels(seen), transition), count)
    return family


def _violations(serving: Iterable[Seen]) -> Metric:
    what = "How often a violation of a requirement began."
    family = CounterMetricFamily("fcsl_run_requirement_violations", what, labels=(*_RUN_LABELS, "requirement"))
    for seen in serving:
        for id_, verdict in seen.stats.get("requirements", {}).items():
            family.add_metric((*_labels(seen), id_), verdict["violations"])
    return family


def _times(serving: Iterable[Seen]) -> Iterator[Metric]:
    labels = (*_RUN_LABELS, "instance")
    runs = CounterMetricFamily(
        "fcsl_run_instance_runs", "Executes of an instance, of a measured machine.", labels=labels
    )
    seconds = CounterMetricFamily("fcsl_run_instance_seconds", "Time of these executes.", labels=labels)
    for seen in serving:
        for instance, row in seen.stats.get("times", {}).items():
            runs.add_metric((*_labels(seen), instance), row["runs"])
            seconds.add_metric((*_labels(seen), instance), row["total_ns"] / 1e9)
    yield runs
    yield seconds


def _histogram(name: str, what: str, rows: Iterable[tuple[Seen, Mapping[str, Any]]]) -> Metric:
    family = HistogramMetricFamily(f"fcsl_run_{name}", what, labels=_RUN_LABELS)
    for seen, times in rows:
        buckets, sum_s = cumulative(times)
        family.add_metric(_labels(seen), buckets, sum_s)
    return family


def cumulative(times: Mapping[str, Any]) -> tuple[list[tuple[str, int]], float]:
    """Cumulative counts by powers of two, upper bounds in s; and the sum in s, which uses each bucket's upper bound: at most
    1/32 too large."""
    buckets: Sequence[Sequence[int]] = times["buckets"]
    ends = [(1 << power) - 1 for power in _POWERS]
    below = [(repr(end / 1e9), sum(count for last, count in buckets if last <= end)) for end in ends]
    nanoseconds = sum(min(last, times["max"]) * count for last, count in buckets)
    return [*below, ("+Inf", sum(count for _, count in buckets))], nanoseconds / 1e9
