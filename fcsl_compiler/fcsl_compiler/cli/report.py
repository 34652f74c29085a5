# SPDX-License-Identifier: Apache-2.0
"""What a run of fcslc found, as one document for programs: JSON of a stable schema, or SARIF 2.1.0.

The JSON is of this schema (`"version": 1`; keys are only ever added):

    {"version": 1, "ok": true,
     "diagnostics": [{"code": "E402", "severity": "error" | "warning", "message": "…", "why": "…", "help": "…",
                      "location": LOCATION, "notes": [{"message": "…", "location": LOCATION}], "rendered": "…"}],
     "machines": [{"config": "…", "name": "…", "instances": 2, "states": 2, "output": "…", "stack_bytes": 512}],
     "failure": "…"}
    LOCATION = {"file": "…", "line": 1, "column": 1, "end_line": 1, "end_column": 5}

`ok` is the exit status; `why` and `help` may be empty; lines and columns count characters from 1, the end column is
exclusive; files are relative to where the compiler was started, if its arguments were; `rendered` is the text format.
`machines` are those that compiled; `output` and `stack_bytes` are of `build`, absent where there is none. `failure` is
there when the tool itself could not do its work (no C compiler, a full disk). `report` is there with `build --report`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from ..base.codes.pages import explain, table
from ..base.diagnostics import Diagnostic, Severity
from ..base.source import Span
from ..model.machine import Machine


@dataclass(frozen=True)
class Summary:
    """A machine that compiled. `output` and `stack_bytes` are set after a build."""

    config: Path
    machine: Machine
    output: Path | None = None
    stack_bytes: int | None = None

    @property
    def instance_count(self) -> int:
        """Without those that requirements become."""
        return len(self.machine.instances) - len(self.machine.effects)

    def text(self) -> str:
        parts = _count(self.instance_count, "instance"), _count(len(self.machine.states), "state")
        return f"{self.config}: ok ({', '.join(parts)})"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"


def error_count(diagnostics: Sequence[Diagnostic]) -> str:
    """`2 errors`, or "" for none."""
    errors = sum(d.severity is Severity.ERROR for d in diagnostics)
    return _count(errors, "error") if errors else ""


def print_report(
    options: argparse.Namespace,
    found: Sequence[Diagnostic],
    machines: Sequence[Summary] = (),
    report: Mapping[str, object] | None = None,
) -> None:
    """Prints the results: text on stderr, or the requested document on stdout, with a resource report in it if there is one."""
    form = getattr(options, "format", "text")
    if form != "text":
        print(document(form, found, machines, report=report), end="")
        return
    for diagnostic in found:
        print(diagnostic.render(), file=sys.stderr)
    if error_count(found):
        print(f"\n{error_count(found)}", file=sys.stderr)


def print_extern_calls(calls: Sequence[str]) -> None:
    """Prints the external functions that the externs of a library call."""
    if calls:
        print(f"functions called by its externs: {', '.join(calls)}")


def document(
    form: str,
    diagnostics: Sequence[Diagnostic],
    machines: Sequence[Summary] = (),
    failure: str = "",
    report: Mapping[str, object] | None = None,
) -> str:
    """The document as text of this form (json or sarif), ending in a newline."""
    content = (_sarif if form == "sarif" else _json)(diagnostics, machines, failure)
    content |= {"report": report} if report is not None else {}
    return json.dumps(content, indent=1) + "\n"


def _json(diagnostics: Sequence[Diagnostic], machines: Sequence[Summary], failure: str) -> dict[str, object]:
    content: dict[str, object] = {
        "version": 1,
        "ok": not failure and all(d.severity is Severity.WARNING for d in diagnostics),
        "diagnostics": [
            {
                "code": d.code,
                "severity": d.severity.value,
                "message": d.message,
                "why": d.why,
                "help": d.help,
                "location": _location(d.span),
                "notes": [{"message": n.text, "location": _location(n.span)} for n in d.notes],
                "rendered": d.render(),
            }
            for d in diagnostics
        ],
        "machines": [_summary(m) for m in machines],
    }
    return {**content, "failure": failure} if failure else content


def _location(span: Span) -> dict[str, object]:
    return {
        "file": span.source.path or span.source.name,
        "line": span.line,
        "column": span.column,
        "end_line": span.end_line,
        "end_column": span.end_column,
    }


def _summary(m: Summary) -> dict[str, object]:
    content: dict[str, object] = {
        "config": str(m.config),
        "name": m.machine.name,
        "instances": m.instance_count,
        "states": len(m.machine.states),
    }
    if m.output is not None:
        content["output"] = str(m.output)
    if m.stack_bytes is not None:
        content["stack_bytes"] = m.stack_bytes
    return content


def _sarif(diagnostics: Sequence[Diagnostic], machines: Sequence[Summary], failure: str) -> dict[str, object]:
    """The report as SARIF 2.1.0. SARIF does not list machines; without results, all of them compiled."""
    del machines
    used = sorted({d.code for d in diagnostics})
    invocation: dict[str, object] = {"executionSuccessful": not failure}
    if failure:
        invocation["toolExecutionNotifications"] = [{"level": "error", "message": {"text": failure}}]
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": {"name": "fcslc", "rules": [_rule(code) for code in used]}},
                "columnKind": "unicodeCodePoints",
                "invocations": [invocation],
                "results": [_result(d, used.index(d.code)) for d in diagnostics],
            }
        ],
    }


def _rule(code: str) -> dict[str, object]:
    row = table()[code]
    return {
        "id": code,
        "shortDescription": {"text": row.title},
        "fullDescription": {"text": row.explanation},
        "help": {"text": explain(code, table())},
        "defaultConfiguration": {"level": "error" if code.startswith("E") else "warning"},
    }


def _result(d: Diagnostic, rule: int) -> dict[str, object]:
    lines = [d.message, *([f"Why: {d.why}"] if d.why else []), *([f"Help: {d.help}"] if d.help else [])]
    return {
        "ruleId": d.code,
        "ruleIndex": rule,
        "level": d.severity.value,
        "message": {"text": "\n".join(lines)},
        "locations": [{"physicalLocation": _physical(d.span)}],
        "relatedLocations": [
            {"id": n, "message": {"text": note.text}, "physicalLocation": _physical(note.span)}
            for n, note in enumerate(d.notes)
        ],
    }


def _physical(span: Span) -> dict[str, object]:
    path = span.source.path or span.source.name
    return {
        "artifactLocation": {"uri": Path(path).as_uri() if path.startswith("/") else quote(path)},
        "region": {
            "startLine": span.line,
            "startColumn": span.column,
            "endLine": span.end_line,
            "endColumn": span.end_column,
        },
    }
