# SPDX-License-Identifier: Apache-2.0
"""The command `fcsl var top`: where the time of a machine's ticks goes."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping
from typing import Any

from ..instance_times import NOT_MEASURED, STEP, InstanceTime, of_stats
from ..screen import Screen
from .answers import open_client, print_answer, status_text
from .client import VarClient
from .show import table
from .wire import VarError

Times = Mapping[str, InstanceTime]
_HEAD = ("instance", "runs", "mean", "p50", "p99", "max", "of the step")
#: What no instance took: due tests, delayed connections, transitions, and the readings of the clock.
_REST = "(rest)"
_PERIOD_S = 1.0


def top(chosen: argparse.Namespace) -> None:
    """Draws the table once a second on a terminal until Ctrl-C; elsewhere prints it once."""
    with open_client(chosen) as client:
        hz = client.describe()["tick_hz"]
        stats, times = _ask(client)
        if chosen.json or not sys.stdout.isatty():
            print_answer(chosen, stats["times"], lambda: "\n".join(lines(stats, times, None, hz)))
            return
        before: Times | None = None
        try:
            with Screen() as screen:
                while True:
                    screen.draw(lines(stats, times, before, hz))
                    time.sleep(_PERIOD_S)
                    before = times
                    stats, times = _ask(client)
        except KeyboardInterrupt:
            pass  # the normal end


def _ask(client: VarClient) -> tuple[dict[str, Any], Times]:
    stats = client.stats()
    times = of_stats(stats.get("times", {}))
    if not times:
        raise VarError("not_measured", NOT_MEASURED.format(client.describe()["machine"]))
    return stats, times


def lines(stats: Mapping[str, Any], times: Times, before: Times | None, tick_hz: float) -> list[str]:
    """What the host counts, and the table."""
    return [status_text(dict(stats)), *_host(stats), "", *table_lines(times, tick_hz, before)]


def table_lines(times: Times, tick_hz: float, before: Times | None = None) -> list[str]:
    """The largest share first. Shares are of the time since `before`, or since the run began."""
    spent = {name: row.total_ns - (before[name].total_ns if before else 0) for name, row in times.items()}
    step_ns = spent.pop(STEP)
    rest = step_ns - sum(spent.values())
    order = sorted(spent, key=lambda name: (-spent[name], -times[name].total_ns))
    rows = [[name, *_figures(times[name]), _share(spent[name], step_ns)] for name in order]
    rows.append([_REST, *[""] * 5, _share(rest, step_ns)])
    step = times[STEP]
    rows.append(["step", *_figures(step), f"{100e-9 * step.mean_ns * tick_hz:.2f} % of the period"])
    return _right([list(_HEAD), *rows]).splitlines()


def _host(stats: Mapping[str, Any]) -> list[str]:
    """What the host counts beside: how long its ticks take in all, how late they come."""
    shown = []
    for member, what in (("tick_time_ns", "tick time"), ("lateness_ns", "lateness")):
        found = stats.get(member, {})
        if found.get("count"):
            figures = "  ".join(f"{key} {_us(found[key])}" for key in ("p50", "p99", "max"))
            shown.append(f"{what}  {figures}")
    missed = [f"{stats[m]} {m.replace('_', ' ')}" for m in ("deadlines_missed", "ticks_skipped") if m in stats]
    return [*shown, *([", ".join(missed)] if missed else [])]


def _figures(row: InstanceTime) -> list[str]:
    if not row.runs:
        return ["0", "", "", "", ""]
    return [str(row.runs), *(_us(ns) for ns in (row.mean_ns, row.p50_ns, row.p99_ns, row.max_ns))]


def _us(ns: int) -> str:
    return f"{ns / 1000:.2f} µs"


def _share(part_ns: int, whole_ns: int) -> str:
    return f"{100 * part_ns / whole_ns:5.1f} %" if whole_ns else ""


def _right(rows: list[list[str]]) -> str:
    """A table with numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)]
    return table([[row[0], *(c.rjust(w) for c, w in zip(row[1:-1], widths[1:], strict=True)), row[-1]] for row in rows])
