# SPDX-License-Identifier: Apache-2.0
"""What a campaign has found: lines of text, and a page."""

from __future__ import annotations

import math
from pathlib import Path
from statistics import NormalDist

import numpy as np

from .case_rows import written_whole
from .page import page
from .requirements import Requirement, requirements
from .results import REPORT, Results
from .study import Study

#: Of failed cases and of errors that the text names.
_NAMED = 5


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
    study = results.study
    lines = [_success(results), *_metric_lines(results)]
    lines += [_requirement_line(study, line) for line in requirements(results)]
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


def _success(results: Results) -> str:
    passed, cases = results.count("passed"), results.study.cases
    low, high = wilson(passed, cases)
    return (
        f"{passed} of {cases} passed: {100 * passed / cases:.4g} %, with 95 % confidence within {100 * low:.4g} and "
        f"{100 * high:.4g} %"
    )


def _requirement_line(study: Study, line: Requirement) -> str:
    """`touchdown_speed < 2.0`: failed in 3 cases, worst by 0.31 m/s in case 17: fcsl campaign …"""
    size = "" if line.margin is None else f"{abs(line.margin):.4g} {line.unit}".strip()
    if line.failed is None:
        return f"`{line.text}`: no metric, so nothing is known of all cases"
    if line.not_exercised and not line.failed:
        flown = study.cases - line.not_exercised
        return f"`{line.text}`: " + (
            f"held in {flown} cases, not exercised in the others" if flown else "not exercised"
        )
    if not line.failed:
        return f"`{line.text}`: held in all cases" + (f", at least by {size} in case {line.case}" if size else "")
    cases = "1 case" if line.failed == 1 else f"{line.failed} cases"
    worst = f"worst by {size} in" if size else "the first is"
    return f"`{line.text}`: failed in {cases}, {worst} case {line.case}: {study.repeat(line.case)}"


def _metric_lines(results: Results) -> list[str]:
    names = list(results.study.metrics)
    width = max(map(len, names), default=0)
    lines = []
    for name, metric in results.study.metrics.items():
        values = results.metric(name)
        values = values[~np.isnan(values)]
        if len(values):
            low, middle, high = np.percentile(values, [1, 50, 99])
            numbers = f"median {middle:.5g}, 1 to 99 %: {low:.5g} to {high:.5g}, all: {values.min():.5g} to {values.max():.5g}"
            numbers += f", {metric.unit}" if metric.unit else ""
            lines.append(f"  {name.ljust(width)}  {numbers}")
        else:
            lines.append(f"  {name.ljust(width)}  never a number")
    return lines


def write_page(results: Results) -> Path:
    """report.html (page.py)."""
    found = requirements(results)
    path = results.folder / REPORT
    with written_whole(path) as temporary:
        text = page(results, _success(results), found, [results.study.repeat(line.case) for line in found])
        temporary.write_text(text, encoding="utf-8")
    return path
