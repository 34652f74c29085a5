# SPDX-License-Identifier: Apache-2.0
"""fcsl trace: which test, and which campaign, exercised which requirement of a machine; the gaps first.

    fcsl test --fcsl-requirements tests.json
    fcsl trace lander_control.json --tests tests.json --campaign touchdown.campaign -o trace.html

Exit status 0: tests that passed exercised each requirement, and no test or campaign speaks against one. 1: there are gaps.
2: bad input.
"""

from __future__ import annotations

import argparse
import csv
import html
import io
import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fcsl_compiler.api.command_line import add_examples
from fcsl_compiler.api.files import write_whole

from .errors import TwinError
from .machine_build import build_config
from .run import open_run

FORMATS = (".html", ".json", ".csv")
_EXAMPLES = {"": "craft.json --tests tests.json"}


@dataclass
class Row:
    """`tests` exercised it and passed, `failed` exercised it and failed, `violating` violated it as they say; `named` are
    those whose mark names it. `campaigns` have for each folder the cases flown, those that exercised it, those that violated
    it. `gaps` say what is missing."""

    id: str
    text: str
    kind: str
    condition: str
    assumed: bool
    tests: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    violating: list[str] = field(default_factory=list)
    named: list[str] = field(default_factory=list)
    campaigns: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    gaps: list[str] = field(default_factory=list)


def matrix(config: str, results: Sequence[str], campaigns: Sequence[str]) -> list[Row]:
    """A row for each requirement of the machine, those with gaps first. Raises TwinError."""
    with closing(open_run(*build_config(config))) as run:
        machine = run.machine.name
        rows = {v.id: Row(v.id, v.text, v.kind, v.source, v.assumed) for v in run.verdicts()}
    if not rows:
        raise TwinError(f"{config}: the machine has no requirements")
    for test in (test for file in results for test in _tests(Path(file))):
        own = test["machines"].get(machine, {"exercised": [], "violated": []})
        for id_ in own["exercised"]:
            if id_ in rows and test["outcome"] in ("passed", "failed"):
                (rows[id_].tests if test["outcome"] == "passed" else rows[id_].failed).append(test["test"])
        for id_ in own["violated"]:
            if id_ in rows and test["outcome"] == "passed":
                rows[id_].violating.append(test["test"])
        for id_ in test["named"]:
            if id_ in rows:
                rows[id_].named.append(test["test"])
    for folder in campaigns:
        _add_campaign(rows, Path(folder))
    for row in rows.values():
        row.gaps = _gaps(row, bool(results))
    return sorted(rows.values(), key=lambda row: not row.gaps)


def _tests(file: Path) -> list[dict[str, Any]]:
    """Of a file of `--fcsl-requirements`."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        tests = found["tests"]
        for test in tests:
            named, machines = test["named"], test["machines"]
            lists = [named, *(ids for own in machines.values() for ids in (own["exercised"], own["violated"]))]
            if not all(isinstance(ids, list) for ids in lists) or not isinstance(test["test"] + test["outcome"], str):
                raise TypeError
    except OSError as error:
        raise TwinError(f"{file}: {error.strerror}") from None
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise TwinError(f"{file}: it is no file of `fcsl test --fcsl-requirements`") from None
    return list(tests)


def _add_campaign(rows: dict[str, Row], folder: Path) -> None:
    import pyarrow as pa  # imported here, because it takes long to load
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(folder / "cases.parquet")
    except (OSError, pa.ArrowException) as error:
        raise TwinError(f"{folder}: it is no folder of a finished campaign: {str(error).splitlines()[0]}") from None
    if not any(f"requirement.{id_}" in table.column_names for id_ in rows):
        raise TwinError(f"{folder}: the campaign is of another machine, or of other requirements")
    for id_, row in rows.items():
        if f"requirement.{id_}" in table.column_names:
            counts = [n for n in table[f"requirement.{id_}"].to_pylist() if n == n]
            row.campaigns[str(folder)] = (len(table), len(counts), sum(n > 0.0 for n in counts))


def _gaps(row: Row, has_tests: bool) -> list[str]:
    gaps = []
    if not row.tests:
        gaps.append("no test exercises it" if has_tests else "no tests are given")
    if row.failed:
        gaps.append(f"{len(row.failed)} tests that exercise it fail")
    if any(violated for _, _, violated in row.campaigns.values()) and not row.assumed:
        gaps.append("a campaign violates it")
    return gaps


def _evidence(row: Row) -> str:
    words = [f"{len(row.tests)} {'test' if len(row.tests) == 1 else 'tests'}"] if row.tests else []
    words += [f"violated on purpose by {len(row.violating)}"] if row.violating else []
    words += [f"named by {len(row.named)}"] if row.named else []
    words += [
        f"{folder}: {exercised} of {cases} cases" + (f", {violated} violate it" if violated else "")
        for folder, (cases, exercised, violated) in row.campaigns.items()
    ]
    return "; ".join(words) or "nothing"


def as_text(rows: Sequence[Row]) -> str:
    width = max(len(row.id) for row in rows)
    lines = []
    for row in rows:
        gaps = f"GAP: {'; '.join(row.gaps)}. " if row.gaps else ""
        lines.append(f"{row.id.ljust(width)}  {gaps}{_evidence(row)}")
    without = sum(bool(row.gaps) for row in rows)
    return "\n".join([*lines, f"{len(rows)} requirements, {without} with gaps"])


def as_csv(rows: Sequence[Row]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["id", "text", "kind", "condition", "assumed", "gaps", "tests", "violating", "named", "campaigns"])
    for row in rows:
        campaigns = [
            f"{folder} {cases} {exercised} {violated}" for folder, (cases, exercised, violated) in row.campaigns.items()
        ]
        lists = [row.gaps, row.tests, row.violating, row.named, campaigns]
        writer.writerow([row.id, row.text, row.kind, row.condition, row.assumed, *map("; ".join, lists)])
    return out.getvalue()


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.4 system-ui, sans-serif; margin: 2em; color: #222 }}
table {{ border-collapse: collapse }} th, td {{ padding: 0.3em 0.8em; text-align: left; vertical-align: top }}
tr {{ border-top: 1px solid #ddd }} tr.gap td:first-child {{ border-left: 4px solid #c8442c }}
code {{ font-size: 13px }} summary {{ cursor: pointer }}
</style></head><body><h1>{title}</h1><p>{summary}</p>
<table><tr><th>requirement</th><th>condition</th><th>gaps</th><th>tests</th><th>campaigns</th></tr>
{rows}
</table></body></html>
"""


def as_html(rows: Sequence[Row], title: str) -> str:
    cells = []
    for row in rows:
        tests = "".join(f"<li><code>{html.escape(test)}</code></li>" for test in row.tests)
        campaigns = "<br>".join(
            f"{html.escape(folder)}: {exercised} of {cases} cases, {violated} violate it"
            for folder, (cases, exercised, violated) in row.campaigns.items()
        )
        cells.append(
            f'<tr class="{"gap" if row.gaps else "whole"}"><td><b>{html.escape(row.id)}</b><br>{html.escape(row.text)}</td>'
            f"<td><code>{html.escape(row.condition)}</code></td><td>{html.escape('; '.join(row.gaps))}</td>"
            f"<td><details><summary>{len(row.tests)}</summary><ul>{tests}</ul></details></td><td>{campaigns}</td></tr>"
        )
    summary = f"{len(rows)} requirements, {sum(bool(row.gaps) for row in rows)} with gaps"
    return _PAGE.format(title=html.escape(title), summary=summary, rows="\n".join(cells))


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl trace", description="Says which tests and campaigns exercised which requirement; the gaps first."
    )
    parser.add_argument("config", help="machine JSON")
    parser.add_argument(
        "--tests",
        action="append",
        default=[],
        metavar="FILE",
        help="of `fcsl test --fcsl-requirements FILE`; may be repeated",
    )
    parser.add_argument(
        "--campaign", action="append", default=[], metavar="FOLDER", help="results of a campaign; may be repeated"
    )
    parser.add_argument("-o", "--output", metavar="FILE", help=f"the matrix as {', '.join(FORMATS)}")
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    parser = make_parser()
    options = parser.parse_args(arguments)
    target = Path(options.output) if options.output else None
    if target is not None and target.suffix not in FORMATS:
        parser.error(f"-o {target}: the name of a matrix ends in {', '.join(FORMATS)}")
    rows = matrix(options.config, options.tests, options.campaign)
    print(as_text(rows))
    if target is not None:
        texts = {
            ".json": lambda: json.dumps({"requirements": [asdict(row) for row in rows]}, indent=1) + "\n",
            ".csv": lambda: as_csv(rows),
            ".html": lambda: as_html(rows, f"Requirements of {Path(options.config).stem}"),
        }
        write_whole(target, texts[target.suffix]())
    return int(any(row.gaps for row in rows))
