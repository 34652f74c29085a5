# SPDX-License-Identifier: Apache-2.0
"""The picture of a search: the best cost by generation, and what the metrics read in a flight before and after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from simclient.errors import BagError
from simclient.view.picture import pyplot, save

from ..campaign.flight import Flights
from ..campaign.metric import Metric
from ..errors import SimError
from .trial_log import Trial

_BLUE, _RED, _GREY = "#2a78b5", "#c8442c", "#888888"
#: Values of the flight that are drawn.
_PANELS = 3
_WIDTH_IN, _PANEL_IN = 8.0, 2.3

Series = tuple[str, str, Any]


def draw(path: Path, flights: Flights, generations: Sequence[Sequence[Trial]], before: Trial, best: Trial) -> None:
    """Writes it, whole or not at all. The flight is of the first case that has not tuned. Raises SimError or TwinError."""
    assert flights.study.tune
    case = flights.study.tune.cases
    responses = [_series(flights, case, ()), _series(flights, case, best.candidate)]
    panels = 1 + len(responses[0])
    size = (_WIDTH_IN, _PANEL_IN * panels)
    figure, grid = pyplot.subplots(panels, 1, squeeze=False, figsize=size, layout="constrained")
    try:
        _convergence(grid[0][0], generations, before, flights.study.tune.minimise)
        for row, (name, unit, old) in enumerate(responses[0], 1):
            _response(grid[row][0], name, unit, old, responses[1][row - 1][2], flights.study.machine.tick_hz)
        if panels > 1:
            grid[-1][0].set_xlabel(f"time, s; case {case}")
        save(figure, path)
    except BagError as error:
        raise SimError(str(error)) from None
    finally:
        pyplot.close(figure)


def _convergence(axes: Any, generations: Sequence[Sequence[Trial]], before: Trial, minimise: Metric) -> None:
    """Of candidates that pass; the others have no place on this axis."""
    passing = [[t.score.cost for t in trials if t.score.missed == 0.0] for trials in generations]
    best = np.minimum.accumulate([min(costs, default=np.inf) for costs in passing])
    for number, costs in enumerate(passing):
        axes.plot([number] * len(costs), costs, ".", color=_GREY, markersize=3)
    axes.plot(np.where(np.isfinite(best), best, np.nan), color=_BLUE, label="best so far")
    if np.isfinite(before.score.cost):
        label = "before" if before.score.missed == 0.0 else "before (does not pass)"
        axes.axhline(before.score.cost, color=_RED, linestyle="--", label=label)
    axes.set(title="candidates that pass", xlabel="generation", ylabel=_labelled(minimise.text, minimise.unit))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    costs = [cost for group in passing for cost in group if cost > 0.0]
    if costs and max(costs) > 20.0 * min(costs):
        axes.set_yscale("log")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _response(axes: Any, name: str, unit: str, old: Any, new: Any, tick_hz: int) -> None:
    for values, colour, label in ((old, _RED, "before"), (new, _BLUE, "after")):
        axes.plot((1 + np.arange(len(values))) / tick_hz, values, color=colour, label=label, linewidth=1.0)
    axes.set(ylabel=_labelled(name, unit))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _labelled(text: str, unit: str) -> str:
    shown = text if len(text) <= 30 else f"…{text[-29:]}"
    return f"{shown}\n{unit}" if unit else shown


def _series(flights: Flights, case: int, gains: tuple[float, ...]) -> list[Series]:
    """The first values that metrics read in all ticks, as numbers over time."""
    columns = flights.trace(case, gains)
    found: dict[str, Series] = {}
    for metric in flights.study.metrics.values():
        for node in metric.root.walk():
            if node.operator != "column" or node.text in found or len(found) == _PANELS:
                continue
            values = np.asarray(metric.part(node, columns, {}))
            if values.dtype.kind in "fiu" and values.ndim == 1:
                machine = flights.study.machine
                found[node.text] = node.text, Metric(node.text, machine).unit, values
    return list(found.values())
