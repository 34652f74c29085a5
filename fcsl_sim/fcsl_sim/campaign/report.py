# SPDX-License-Identifier: Apache-2.0
"""What a campaign has found: a few lines of text, and a picture."""

from __future__ import annotations

import math
from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np

from .case_rows import written_whole
from .results import PICTURE, Results

#: Of failed cases and of errors that the text names.
_NAMED = 5
_BINS = 40
_PER_ROW = 3
#: Cases in the panels of parameters.
_DOTS = 5000
_PASSED, _FAILED = "#2a78b5", "#c8442c"


def wilson(passed: int, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """The interval in which the share of passes lies with this confidence, after `passed` of `count` > 0. Source: E. B. Wilson,
    Journal of the American Statistical Association 22 (1927) 209."""
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    share = passed / count
    centre = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    return max(0.0, centre - half), min(1.0, centre + half)


def text(results: Results) -> str:
    """The numbers of cases, the success with its confidence, a line for each metric, and the cases that failed."""
    study, passed = results.study, results.count("passed")
    low, high = wilson(passed, study.cases)
    lines = [
        f"{passed} of {study.cases} passed: {100 * passed / study.cases:.4g} %, with 95 % confidence within "
        f"{100 * low:.4g} and {100 * high:.4g} %"
    ]
    lines += _metric_lines(results)
    for verdict in ("failed", "error"):
        count = results.count(verdict)
        for case in results.cases_of(verdict, _NAMED):
            outcome = results.outcome(case)
            values = ", ".join(f"{p.path} = {v:.6g}" for p, v in zip(study.parameters, outcome.values, strict=True))
            why = "; ".join(filter(None, [outcome.error or outcome.failed_by, values if not outcome.error else ""]))
            lines.append(f"case {case} {verdict}: {why}")
        if count > _NAMED:
            lines.append(f"… and {count - _NAMED} more of `{verdict}`: {results.folder}/cases.parquet has all")
    return "\n".join(lines)


def _metric_lines(results: Results) -> list[str]:
    names = list(results.study.metrics)
    width = max(map(len, names), default=0)
    lines = []
    for name in names:
        values = results.metric(name)
        values = values[~np.isnan(values)]
        if len(values):
            low, middle, high = np.percentile(values, [1, 50, 99])
            numbers = f"median {middle:.5g}, 1 to 99 %: {low:.5g} to {high:.5g}, all: {values.min():.5g} to {values.max():.5g}"
            lines.append(f"  {name.ljust(width)}  {numbers}")
        else:
            lines.append(f"  {name.ljust(width)}  never a number")
    return lines


def draw(results: Results) -> Path:
    """report.png: a histogram of each metric, and each dispersed parameter over its cases, with those that did not pass."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    study = results.study
    passed = results.passed()
    metrics = [(name, results.metric(name)) for name in study.metrics]
    shown = np.arange(0, study.cases, max(1, study.cases // _DOTS))
    columns = list(zip(*(study.values(int(case)) for case in shown), strict=True))
    parameters = [(p.path, np.array(c, float)) for p, c in zip(study.parameters, columns, strict=True)]
    panels = len(metrics) + len(parameters)
    rows = max(1, math.ceil(panels / _PER_ROW))
    figure = Figure(figsize=(4.2 * _PER_ROW, 0.9 + 2.7 * rows), layout="constrained")
    low, high = wilson(int(passed.sum()), study.cases)
    title = f"{study.path.name}: {int(passed.sum())} of {study.cases} passed, 95 % confidence {100 * low:.3g} to {100 * high:.3g} %"
    figure.suptitle(title, fontsize=11)
    for number, (name, values) in enumerate(metrics):
        _histogram(figure.add_subplot(rows, _PER_ROW, number + 1), name, values, passed)
    name, heights = metrics[0] if metrics else ("case", np.arange(study.cases))
    for number, (path, values) in enumerate(parameters, start=len(metrics)):
        axes = figure.add_subplot(rows, _PER_ROW, number + 1)
        _scatter(axes, (path, values), (name, heights[shown]), passed[shown])
    picture = results.folder / PICTURE
    with written_whole(picture) as temporary:
        figure.savefig(temporary, format="png", dpi=90, metadata={"Software": ""})
    return picture


def _histogram(axes: Any, name: str, values: Any, passed: Any) -> None:
    finite = np.isfinite(values)
    if finite.any():
        span = values[finite].min(), values[finite].max()
        edges = np.linspace(*(span if span[0] < span[1] else (span[0] - 0.5, span[1] + 0.5)), _BINS + 1)
        groups = [values[finite & passed], values[finite & ~passed]]
        axes.hist(groups, edges, stacked=True, color=[_PASSED, _FAILED], label=["passed", "not passed"])
    axes.set_xlabel(name, fontsize=8)
    axes.set_ylabel("cases", fontsize=8)
    axes.tick_params(labelsize=7)


def _scatter(axes: Any, across: tuple[str, Any], up: tuple[str, Any], passed: Any) -> None:
    (path, values), (name, heights) = across, up
    for group, colour in ((passed, _PASSED), (~passed, _FAILED)):
        axes.plot(values[group], heights[group], ".", color=colour, markersize=3, rasterized=True)
    axes.set_xlabel(path, fontsize=8)
    axes.set_ylabel(name, fontsize=8)
    axes.tick_params(labelsize=7)
