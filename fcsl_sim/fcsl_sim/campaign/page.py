# SPDX-License-Identifier: Apache-2.0
"""report.html: the results of a campaign as one page that needs nothing else, and no network.

Tables of requirements and metrics, a histogram of each metric with the limits that `pass` sets, and any metric or parameter
against any other: the page's script draws what is chosen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

from .requirements import Requirement, limits
from .results import Results

#: Cases among which points are drawn: all up to here, then each n-th.
_POINTS = 3000
_BINS = 40
_DIGITS = 6

_HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 14px/1.4 system-ui, sans-serif; margin: 2em auto; max-width: 1200px; padding: 0 1em; color: #1f2328 }}
table {{ border-collapse: collapse }} td, th {{ padding: 3px 10px; border-bottom: 1px solid #d8dee4; text-align: left }}
td.number {{ text-align: right; white-space: nowrap }} .failed {{ color: #b03a26; font-weight: bold }} code {{ font-size: 12px }}
#requirements code {{ white-space: nowrap }}
select {{ font: inherit; margin: 0 1.5em 0 0.4em }} svg {{ background: #fff }}
#histograms {{ display: flex; flex-wrap: wrap }}
</style></head><body>
<h1>{title}</h1>
"""
#: `data` comes before it. Each value has its name, unit, values by point, and limits; metrics also have bins of all cases.
_SCRIPT = """
const colours = {passed: "#2a78b5", failed: "#c8442c", error: "#8a8a8a"};
const shown = number => String(Number(number.toPrecision(4)));
const safe = text => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
const title = value => safe(value.name + (value.unit ? ", " + value.unit : ""));

function ticks(low, high) {
  const rough = (high - low) / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find(factor => factor * power >= rough);
  const found = [];
  for (let n = Math.ceil(low / step); n * step <= high; n++) found.push(n * step);
  return found;
}

function range(numbers) {
  const low = Math.min(...numbers), high = Math.max(...numbers), wide = high - low || Math.abs(low) || 1;
  return [low - 0.04 * wide, high + 0.04 * wide];
}

// A frame with its axes; `body` gets functions from values to places.
function plot(width, height, x, y, names, body) {
  const left = 70, right = width - 15, top = 12, bottom = height - 45;
  const px = value => left + (value - x[0]) / (x[1] - x[0]) * (right - left);
  const py = value => bottom - (value - y[0]) / (y[1] - y[0]) * (bottom - top);
  const line = (x1, y1, x2, y2, more) => `<line x1="${x1}" y1="${y1}" x2="${x2}" y2="${y2}" ${more}/>`;
  const text = (tx, ty, words, more) => `<text x="${tx}" y="${ty}" font-size="11" fill="#333" ${more}>${words}</text>`;
  let out = "";
  for (const v of ticks(...x)) out += line(px(v), top, px(v), bottom, 'stroke="#e4e4e4"') + text(px(v), bottom + 15, shown(v), 'text-anchor="middle"');
  for (const v of ticks(...y)) out += line(left, py(v), right, py(v), 'stroke="#e4e4e4"') + text(left - 6, py(v) + 4, shown(v), 'text-anchor="end"');
  out += body(px, py, line, text, [left, right, top, bottom]);
  out += `<rect x="${left}" y="${top}" width="${right - left}" height="${bottom - top}" fill="none" stroke="#888"/>`;
  out += text((left + right) / 2, height - 10, names[0], 'text-anchor="middle"');
  out += text(0, 0, names[1], `text-anchor="middle" transform="translate(14 ${(top + bottom) / 2}) rotate(-90)"`);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}">${out}</svg>`;
}

const limit = 'stroke="#b03a26" stroke-width="1.5" stroke-dasharray="6 3"';

const named = (x, y, right, each, text) => x > right - 60 ? text(x - 4, y, safe(each.text), 'text-anchor="end"') : text(x + 4, y, safe(each.text), "");

function histogram(metric) {
  const {low, high, passed, others} = metric.bins, step = (high - low) / passed.length;
  const x = range([low, high, ...metric.limits.map(each => each.value)]);
  const y = [0, 1.05 * Math.max(1, ...passed.map((count, i) => count + others[i]))];
  return plot(380, 230, x, y, [title(metric), "cases"], (px, py, line, text, [left, right, top, bottom]) => {
    let out = "";
    passed.forEach((count, i) => {
      for (const [from, to, colour] of [[0, count, colours.passed], [count, count + others[i], colours.failed]])
        if (to > from) out += `<rect x="${px(low + i * step)}" y="${py(to)}" width="${px(low + step) - px(low)}" height="${py(from) - py(to)}" fill="${colour}"/>`;
    });
    for (const each of metric.limits) out += line(px(each.value), top, px(each.value), bottom, limit) + named(px(each.value), top + 12, right, each, text);
    return out;
  });
}

function scatter(across, up) {
  const there = data.cases.map((_, i) => i).filter(i => across.values[i] !== null && up.values[i] !== null);
  if (!there.length) return "<p>no case has a number for both</p>";
  const of = value => range([...there.map(i => value.values[i]), ...value.limits.map(each => each.value)]);
  return plot(1000, 560, of(across), of(up), [title(across), title(up)], (px, py, line, text, [left, right, top, bottom]) => {
    let out = "";
    for (const verdict of ["passed", "error", "failed"])
      for (const i of there.filter(i => data.verdicts[i] === verdict))
        out += `<circle cx="${px(across.values[i]).toFixed(1)}" cy="${py(up.values[i]).toFixed(1)}" r="3" fill="${colours[verdict]}" fill-opacity="0.7"><title>case ${data.cases[i]}, ${verdict}: ${shown(across.values[i])}, ${shown(up.values[i])}</title></circle>`;
    for (const each of up.limits) out += line(left, py(each.value), right, py(each.value), limit) + text(right - 4, py(each.value) - 5, safe(each.text), 'text-anchor="end"');
    for (const each of across.limits) out += line(px(each.value), top, px(each.value), bottom, limit) + named(px(each.value), top + 12, right, each, text);
    return out;
  });
}

const values = [...data.parameters, ...data.metrics];
const [across, up] = ["across", "up"].map(name => document.getElementById(name));
for (const [select, chosen] of [[across, data.across], [up, data.up]]) {
  select.innerHTML = values.map((value, i) => `<option value="${i}">${title(value)}</option>`).join("");
  select.value = chosen;
  select.onchange = draw;
}
function draw() {
  document.getElementById("plot").innerHTML = scatter(values[across.value], values[up.value]);
}
document.getElementById("histograms").innerHTML = data.metrics.filter(metric => metric.bins).map(histogram).join("");
if (values.length) draw();
"""


def page(results: Results, summary: str, found: Sequence[Requirement], commands: Sequence[str]) -> str:
    """summary: the sentence at its head. commands: for each requirement what repeats its case, or nothing."""
    title = escape(results.study.path.name)
    data = json.dumps(_data(results, found), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return "\n".join(
        [
            _HEAD.format(title=title) + f"<p>{escape(summary)}</p>",
            *(["<h2>Requirements</h2>", _requirements(found, commands)] if found else []),
            "<h2>Metrics</h2>",
            _metrics(results),
            '<div id="histograms"></div>',
            "<h2>Any value against any other</h2>",
            '<p><label>vertical<select id="up"></select></label><label>horizontal<select id="across"></select></label>',
            f"{_key('passed')} {_key('failed')} {_key('error')}</p>",
            '<div id="plot"></div>',
            f"<script>\nconst data = {data};{_SCRIPT}</script>",
            "</body></html>\n",
        ]
    )


def _key(verdict: str) -> str:
    colour = {"passed": "#2a78b5", "failed": "#c8442c", "error": "#8a8a8a"}[verdict]
    return f'<span style="color:{colour}">●</span> {verdict}'


def _table(head: Sequence[str], rows: Iterable[str]) -> str:
    heads = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    return f"<table><tr>{heads}</tr>\n" + "\n".join(rows) + "\n</table>"


def _requirements(found: Sequence[Requirement], commands: Sequence[str]) -> str:
    rows = []
    for line, command in zip(found, commands, strict=True):
        failed = "not known by the metrics" if line.failed is None else str(line.failed)
        margin = "" if line.margin is None else f"{line.margin:.4g} {line.unit}".strip()
        case = "" if line.case is None else str(line.case)
        if line.not_exercised:
            failed += f" ({line.not_exercised} not exercised)"
        mark = ' class="failed"' if line.failed else ""
        cells = (
            f'<td class="number">{failed}</td><td class="number">{escape(margin)}</td><td class="number">{case}</td>'
        )
        repeat = f"<code>{escape(command)}</code>" if command else ""
        rows.append(f"<tr><td{mark}><code>{escape(line.text)}</code></td>{cells}<td>{repeat}</td></tr>")
    table = _table(("requirement", "cases that failed", "least margin", "in case", "repeat it"), rows)
    return f'<div id="requirements">{table}</div>'


def _metrics(results: Results) -> str:
    rows = []
    for name, metric in results.study.metrics.items():
        numbers = _finite(results.metric(name))
        shown = ["never a number", *[""] * 4]
        if len(numbers):
            shown = [f"{value:.5g}" for value in np.percentile(numbers, [0, 1, 50, 99, 100])]
        cells = "".join(f'<td class="number">{cell}</td>' for cell in shown)
        text = f"<td>{escape(name)}</td><td>{escape(metric.unit)}</td>"
        rows.append(f"<tr>{text}{cells}<td><code>{escape(metric.text)}</code></td></tr>")
    return _table(("metric", "unit", "least", "1 %", "median", "99 %", "greatest", "expression"), rows)


def _data(results: Results, found: Sequence[Requirement]) -> dict[str, Any]:
    """What the script draws. First it shows the metric of the line that fails in most cases, against the first parameter."""
    study = results.study
    step = max(1, math.ceil(study.cases / _POINTS))
    cases = sorted({*range(0, study.cases, step), *(line.case for line in found if line.case is not None)})
    rows = list(zip(*(study.values(case) for case in cases), strict=True)) or [()] * len(study.parameters)
    parameters = [
        {"name": p.path, "unit": p.field.unit, "values": [_short(v) for v in column], "limits": []}
        for p, column in zip(study.parameters, rows, strict=True)
    ]
    set_by_pass = limits(study)
    metrics = []
    for name, metric in study.metrics.items():
        numbers = results.metric(name)
        drawn = [{"value": limit.value, "text": limit.text} for limit in set_by_pass.get(name, ())]
        one = {"name": name, "unit": metric.unit, "values": [_short(numbers[case]) for case in cases], "limits": drawn}
        metrics.append(one | {"bins": _bins(numbers, results.of("passed"))})
    verdicts = {verdict: results.of(verdict) for verdict in ("passed", "failed", "error")}
    worst = max(found, key=lambda line: line.failed or 0, default=None)
    names = list(study.metrics)
    up = next((i for i, name in enumerate(names) if worst and name in worst.text), 0)
    return {
        "cases": cases,
        "verdicts": [next(verdict for verdict, has in verdicts.items() if has[case]) for case in cases],
        "parameters": parameters,
        "metrics": metrics,
        "across": 0,
        "up": len(parameters) + up if metrics else 0,
    }


def _bins(values: Any, passed: Any) -> dict[str, Any] | None:
    """Of all cases, those that passed and the others."""
    known = np.isfinite(values)
    if not known.any():
        return None
    low, high = float(values[known].min()), float(values[known].max())
    if low == high:
        low, high = low - 0.5, high + 0.5
    passing, _ = np.histogram(values[known & passed], _BINS, (low, high))
    others, _ = np.histogram(values[known & ~passed], _BINS, (low, high))
    return {"low": low, "high": high, "passed": passing.tolist(), "others": others.tolist()}


def _finite(values: Any) -> Any:
    return values[np.isfinite(values)]


def _short(value: float) -> float | None:
    return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
