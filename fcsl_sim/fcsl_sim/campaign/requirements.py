# SPDX-License-Identifier: Apache-2.0
"""The lines of `pass` and the requirements of the machine: in how many cases each did not hold, by how much, and where the
limits are that `pass` sets to metrics.

`landed and touchdown_speed < 2.0` has two lines. A line is judged by the metrics of all cases. One that reads values of the
flight itself is not, unless what it reads is written as a metric is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcsl_compiler.api.expressions import Kind, Node

from .metric import Metric, MetricError
from .results import Results
from .study import Study

Array = np.ndarray[Any, Any]

#: The operator with its sides exchanged.
_TURNED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


@dataclass(frozen=True)
class Requirement:
    """`failed`: cases in which it did not hold; None: the metrics do not say. `margin`: the smallest of all cases, negative where
    it did not hold; None: it is no comparison. `case`: that of the margin, or one that failed; None: there is none.
    `not_exercised`: cases that show nothing of it."""

    text: str
    unit: str = ""
    failed: int | None = None
    margin: float | None = None
    case: int | None = None
    not_exercised: int = 0


@dataclass(frozen=True)
class JudgedLine:
    """In each case: `holds` (None: the metrics do not say), `margins` and `sizes` (that of both sides) of a comparison of numbers."""

    text: str
    unit: str = ""
    holds: Array | None = None
    margins: Array | None = None
    sizes: Array | None = None


@dataclass(frozen=True)
class Limit:
    """`text`: `< 2.0`."""

    value: float
    text: str


def requirements(results: Results) -> list[Requirement]:
    """Each line of `pass`, and each requirement of the machine that is no assumption, over all cases that ended without an
    error."""
    study = results.study
    flown = ~results.of("error")
    numbers = {name: results.metric(name) for name in study.metrics}
    found = [_summed(line, flown) for line in judge_lines(study, numbers, study.cases)]
    for verdict in study.required.values():
        if not verdict.assumed:
            violations = results.metric(f"requirement.{verdict.id}")
            failed, silent = flown & (violations > 0.0), flown & np.isnan(violations)
            case = int(np.argmax(failed)) if failed.any() else None
            text = f"{verdict.id}: {verdict.text}"
            found.append(Requirement(text, "", int(failed.sum()), None, case, int(silent.sum())))
    return found


def limits(study: Study) -> dict[str, list[Limit]]:
    """Those that `pass` sets to a metric or to its absolute value, as numbers."""
    found: dict[str, list[Limit]] = {}
    for line in _lines(study.passes.root) if study.passes else ():
        if line.operator != "compare":
            continue
        (left, right), (operator,) = line.parts, line.value
        for side, other, way in ((left, right, operator), (right, left, _TURNED[operator])):
            inner = side.parts[0] if side.operator == "abs" else side
            name = _metric_of(inner, study)
            value = _constant(other, study)
            if name is None or value is None:
                continue
            text = f"{way} {other.text}"
            if side is inner:
                found.setdefault(name, []).append(Limit(value, text))
            else:
                found.setdefault(name, []).extend([Limit(value, f"abs {text}"), Limit(-value, f"abs {text}")])
    return found


def _lines(node: Node) -> Iterator[Node]:
    """What `and` joins; of a chain of comparisons each."""
    if node.operator == "and":
        for part in node.parts:
            yield from _lines(part)
    elif node.operator == "compare":
        for left, operator, right in zip(node.parts, node.value, node.parts[1:], strict=False):
            text = f"{left.text} {operator} {right.text}"
            yield replace(node, text=text, parts=(left, right), value=(operator,))
    else:
        yield node


def judge_lines(study: Study, numbers: Mapping[str, Array], cases: int) -> list[JudgedLine]:
    """Each line of `pass`. numbers: the columns of the study over the cases."""
    passes = study.passes
    if passes is None:
        return []
    metrics = {name: _typed(metric, numbers[name]) for name, metric in study.metrics.items()}
    return [_judged(line, study, passes, metrics, cases) for line in _lines(passes.root)]


def _judged(line: Node, study: Study, passes: Metric, metrics: dict[str, Array], cases: int) -> JudgedLine:
    sides = [_values(part, study, passes, metrics, cases) for part in line.parts]
    if line.operator == "compare" and sides[0] is not None and sides[1] is not None:
        left, right = sides[0], sides[1]
        compare = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal}
        (operator,) = line.value
        holds = left != right if operator == "!=" else compare[operator](left, right)
        if left.dtype.kind not in "fi" or right.dtype.kind not in "fi" or operator == "!=":
            return JudgedLine(line.text, holds=holds)
        distance = right - left if operator in ("<", "<=") else left - right
        names = (_metric_of(part.parts[0] if part.operator == "abs" else part, study) for part in line.parts)
        unit = next((study.metrics[name].unit for name in names if name), "")
        margins = -np.abs(distance) if operator == "==" else distance
        return JudgedLine(line.text, unit, holds, margins, np.abs(left) + np.abs(right))
    found = _values(line, study, passes, metrics, cases)
    return JudgedLine(line.text, holds=None if found is None else found.astype(bool))


def _summed(line: JudgedLine, flown: Array) -> Requirement:
    """flown: which cases have ended without an error."""
    if line.holds is None:
        return Requirement(line.text)
    failed = flown & ~line.holds
    among = failed if failed.any() else flown
    if line.margins is not None and np.isfinite(line.margins[among]).any():
        case = int(np.nanargmin(np.where(among & np.isfinite(line.margins), line.margins, np.nan)))
        return Requirement(line.text, line.unit, int(failed.sum()), float(line.margins[case]), case)
    case_of = int(np.argmax(failed)) if failed.any() else None
    return Requirement(line.text, line.unit, int(failed.sum()), None, case_of)


def _values(node: Node, study: Study, passes: Metric, metrics: dict[str, Array], cases: int) -> Array | None:
    """Of a part of `pass` in each case; None: it reads values of the flight."""
    name = _metric_of(node, study)
    if name is not None:
        return metrics[name]
    if any(leaf.operator in ("field", "column") for leaf in node.walk()):
        return None
    try:
        return np.broadcast_to(np.asarray(passes.part(node, {}, metrics)), cases)
    except MetricError:
        return None


def _metric_of(node: Node, study: Study) -> str | None:
    """The metric that a part of `pass` is: by its name, or written like it."""
    if node.operator == "metric":
        return str(node.value)
    return next((name for name, metric in study.metrics.items() if metric.text.strip() == node.text), None)


def _constant(node: Node, study: Study) -> float | None:
    if node.quantity.kind is Kind.NAME or any(leaf.operator in ("field", "column", "metric") for leaf in node.walk()):
        return None
    assert study.passes is not None
    return float(study.passes.part(node, {}, {}))


def _typed(metric: Metric, values: Array) -> Array:
    """Metrics are kept as doubles; a bool is one again."""
    return values == 1.0 if metric.quantity.kind is Kind.BOOL else values
