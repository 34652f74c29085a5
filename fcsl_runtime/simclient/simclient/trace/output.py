# SPDX-License-Identifier: Apache-2.0
"""A trace matrix as text, JSON, CSV and HTML."""

from __future__ import annotations

import csv
import html
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict

from .matrix import Row


def as_text(rows: Sequence[Row]) -> str:
    width = max(len(row.id) for row in rows)
    lines = []
    for row in rows:
        gaps = f"GAP: {'; '.join(row.gaps)}. " if row.gaps else ""
        lines.append(f"{row.id.ljust(width)}  {gaps}{_evidence(row)}")
    return "\n".join([*lines, _summary(rows)])


def _summary(rows: Sequence[Row]) -> str:
    return f"{len(rows)} requirements, {sum(bool(row.gaps) for row in rows)} with gaps"


def _evidence(row: Row) -> str:
    words = [f"{len(row.tests)} {'test' if len(row.tests) == 1 else 'tests'}"] if row.tests else []
    words += [f"violated on purpose by {len(row.violating)}"] if row.violating else []
    words += [f"named by {len(row.named)}"] if row.named else []
    words += [
        f"{folder}: {exercised} of {cases} cases" + (f", {violated} violate it" if violated else "")
        for folder, (cases, exercised, violated) in row.campaigns.items()
    ]
    words += [f"MC/DC {_share(row)}"] if row.mcdc is not None else []
    words += map(str, row.proofs)
    return "; ".join(words) or "nothing"


def _share(row: Row) -> str:
    """Of conditions; "-" where its algorithms have none, or it watches none."""
    return f"{row.mcdc[0]} of {row.mcdc[1]}" if row.mcdc is not None and row.mcdc[1] else "-"


def as_json(rows: Sequence[Row]) -> str:
    return json.dumps({"requirements": [asdict(row) for row in rows]}, indent=1) + "\n"


def as_csv(rows: Sequence[Row]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = ["id", "text", "kind", "condition", "assumed", "gaps", "tests", "violating", "named", "campaigns"]
    writer.writerow([*names, "mcdc", "proofs", "at", "monitor", "python", "c"])
    for row in rows:
        campaigns = [
            f"{folder} {cases} {exercised} {violated}" for folder, (cases, exercised, violated) in row.campaigns.items()
        ]
        lists = [row.gaps, row.tests, row.violating, row.named, campaigns]
        code = [row.code.at, row.code.monitor, "; ".join(row.code.python), "; ".join(row.code.c)]
        mcdc = "" if row.mcdc is None else _share(row)
        head = [row.id, row.text, row.kind, row.condition, row.assumed]
        writer.writerow([*head, *map("; ".join, lists), mcdc, "; ".join(map(str, row.proofs)), *code])
    return out.getvalue()


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.4 system-ui, sans-serif; margin: 2em; color: #222 }}
table {{ border-collapse: collapse }} th, td {{ padding: 0.3em 0.8em; text-align: left; vertical-align: top }}
tr {{ border-top: 1px solid #ddd }} tr.gap td:first-child {{ border-left: 4px solid #c8442c }}
code {{ font-size: 13px }} summary {{ cursor: pointer; white-space: nowrap }} ul {{ margin: 0; padding-left: 1.2em }}
</style></head><body><h1>{title}</h1><p>{summary}</p>
<table><tr><th>requirement</th><th>condition</th><th>gaps</th><th>tests</th><th>campaigns</th><th>MC/DC</th>
<th>proofs</th><th>code</th></tr>
{rows}
</table></body></html>
"""


def as_html(rows: Sequence[Row], title: str) -> str:
    lines = []
    for row in rows:
        campaigns = [
            f"{folder}: {exercised} of {cases} cases, {violated} violate it"
            for folder, (cases, exercised, violated) in row.campaigns.items()
        ]
        proofs = [f"{proof}" + "".join(f"; assumes {a}" for a in proof.assumptions) for proof in row.proofs]
        code = [row.code.monitor, *row.code.python, *row.code.c]
        cells = [
            f"<b>{html.escape(row.id)}</b><br>{html.escape(row.text)}",
            f"<code>{html.escape(row.condition)}</code>",
            html.escape("; ".join(row.gaps)),
            _folded(str(len(row.tests)), row.tests),
            "<br>".join(map(html.escape, campaigns)),
            "" if row.mcdc is None else _share(row),
            "<br>".join(map(html.escape, proofs)),
            _folded(row.code.at, code),
        ]
        style = "gap" if row.gaps else "whole"
        lines.append(f'<tr class="{style}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return _PAGE.format(title=html.escape(title), summary=_summary(rows), rows="\n".join(lines))


def _folded(title: str, items: Iterable[str]) -> str:
    inner = "".join(f"<li><code>{html.escape(item)}</code></li>" for item in items)
    return f"<details><summary>{html.escape(title)}</summary><ul>{inner}</ul></details>"
