# SPDX-License-Identifier: Apache-2.0
"""The pages show the limits that the programs have: each table of limits in the sources is a table of a page."""

from __future__ import annotations

import re
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


def shown_limits(page: Path) -> dict[str, int]:
    """First column → second column of the page's tables headed `limit | value`."""
    found: dict[str, int] = {}
    for table in re.findall(r"^\| limit \| value \|\n\|---\|---\|\n((?:\|.*\n)+)", page.read_text(), re.M):
        for row in table.splitlines():
            text, value = (cell.strip() for cell in row.strip("|").rsplit("|", 1))
            found[text] = int(value.replace(" ", ""))
    return found


def test_the_variable_server() -> None:
    header = c_limits(ROOT / "fcsl_runtime/fcsl_runtime/src/vars/limits.h")
    assert len(header) > 20 and shown_limits(ROOT / "docs/protocol.md") == header
