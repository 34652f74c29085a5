# SPDX-License-Identifier: Apache-2.0
"""The HTML page: the runs, with links to their details. No scripts."""

from __future__ import annotations

import time
from collections.abc import Sequence
from html import escape
from typing import Any

_STYLE = (
    "body{font:15px sans-serif;margin:2em}table{border-collapse:collapse}th,td{padding:.3em .8em;text-align:left;"
    "border-bottom:1px solid #ccc}.nominal,.stale{color:#060}.degraded{color:#a60}.failed,.stalled,.unresponsive{color:#b00}"
)
#: Forbids external resources and embedding in frames.
SECURITY_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
_REFRESH_S = 5


def page(rows: Sequence[tuple[dict[str, Any], dict[str, Any]]]) -> str:
    """`rows`: description and health of each run."""
    body = "".join(_row(run, health) for run, health in rows) or "<tr><td colspan=6>none</td></tr>"
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="{_REFRESH_S}">'
        f"<title>FCSL runs</title><style>{_STYLE}</style></head><body><h1>Runs</h1><table>"
        "<tr><th>run</th><th>what</th><th>file</th><th>since</th><th>status</th><th>health</th></tr>"
        f'{body}</table><p><a href="/metrics">metrics</a> <a href="/health">health</a></p></body></html>\n'
    )


def _row(run: dict[str, Any], health: dict[str, Any]) -> str:
    name = escape(run["id"])
    since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(run["started"]))
    status = run["status"] if run["exit"] is None else f"ended: {run['exit']['status']}, {run['exit']['meaning']}"
    word = escape(health["health"])
    where = f", {health['state']}, tick {health['tick']}" if "tick" in health else ""
    return (
        f'<tr><td><a href="/runs/{name}">{name}</a></td><td>{escape(run["kind"])}</td><td>{escape(run["file"])}</td>'
        f'<td>{since}</td><td>{escape(status)}</td><td><a class="{word}" href="/runs/{name}/health">{word}</a>'
        f"{escape(where)}</td></tr>"
    )
