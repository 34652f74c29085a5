# SPDX-License-Identifier: Apache-2.0
"""The pages show the limits that the programs have: each table of limits in the sources is a table of a page."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

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
    assert len(header) > 20 and shown_limits(ROOT / "docs/protocol.md") == header


def python_limits(module: Path) -> dict[str, float]:
    """Comment → value of each constant of a module."""
    values: dict[str, float] = runpy.run_path(str(module))
    rows = re.findall(r"^#: (.*)\n(\w+) = ", module.read_text(), re.M)
    assert len(rows) == sum(name.isupper() for name in values)
    return {text: values[name] for text, name in rows}


@pytest.mark.parametrize("name", ["supervisor", "telemetry"])
def test_in_python(name: str) -> None:
    limits = python_limits(ROOT / f"fcsl_runtime/simclient/simclient/{name}/limits.py")
    assert len(limits) > 10 and shown_limits(ROOT / f"docs/{name}.md") == limits
