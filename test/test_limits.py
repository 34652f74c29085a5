# SPDX-License-Identifier: Apache-2.0
"""The pages show the limits that the programs have: each table of limits in the sources is a table of a page."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def c_limits(header: Path) -> dict[str, int]:
    """Comment → value of each enumerator of a header."""
    rows = re.findall(r"^ +\w+ = ([\d* ]+),?\s*/\* (.*?) \*/$", header.read_text(), re.M)
    limits = {text: 1 for _, text in rows}
    for value, text in rows:
        for factor in value.split("*"):
            limits[text] *= int(factor)
    return limits


def shown_limits(page: Path) -> dict[str, float]:
    """First column → second column of the page's tables headed `limit | value`."""
    found: dict[str, float] = {}
    for table in re.findall(r"^\| limit \| value \|\n\|---\|---\|\n((?:\|.*\n)+)", page.read_text(), re.M):
        for row in table.splitlines():
            text, value = (cell.strip() for cell in row.strip("|").rsplit("|", 1))
            found[text] = float(value.replace(" ", ""))
    return found


def test_the_variable_server() -> None:
    runtime = ROOT / "fcsl_runtime/fcsl_runtime"
    header = c_limits(runtime / "src/vars/limits.h") | c_limits(runtime / "include/fcsl/fcsl_expression.h")
    assert len(header) > 20 and shown_limits(ROOT / "docs/reference/variables.md") == header


def python_limits(module: Path) -> dict[str, float]:
    """Comment → value of each constant of a module."""
    values: dict[str, float] = runpy.run_path(str(module))
    rows = re.findall(r"^#: (.*)\n(\w+) = ", module.read_text(), re.M)
    assert len(rows) == sum(name.isupper() for name in values)
    return {text: values[name] for text, name in rows}


def test_supervisor_and_telemetry() -> None:
    """Both stand on one page, in a table each."""
    modules = [ROOT / f"fcsl_runtime/simclient/simclient/{name}/limits.py" for name in ("supervisor", "telemetry")]
    limits = python_limits(modules[0]) | python_limits(modules[1])
    assert len(limits) > 20 and shown_limits(ROOT / "docs/guide/monitoring.md") == limits
