# SPDX-License-Identifier: Apache-2.0
"""`python3 scripts/failed_tests.py FOLDER`: the tests that failed and why, of every JUnit and CTest file below FOLDER. The last lines that
`make test` prints, so that whoever sees only the end of a long output knows what happened and what to run again."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

#: Of a message: what a process printed stands in its later lines.
_LINES_MAX, _CHARACTERS_MAX = 12, 300


def failed(file: Path) -> list[str]:
    """`name: message`, its lines below each other; a file that cannot be read counts as failed."""
    try:
        root = ET.parse(file).getroot()
    except ET.ParseError as error:
        return [f"{file}: {error}"]
    lines = [f"{file}: {test.findtext('Name')}" for test in root.iter("Test") if test.get("Status") == "failed"]
    for case in root.iter("testcase"):
        for outcome in (*case.findall("failure"), *case.findall("error")):
            message = (outcome.get("message") or outcome.text or "").strip().splitlines()
            first, *more = message[:_LINES_MAX] or [""]
            lines.append(f"{case.get('classname', '')}::{case.get('name', '')}: {first}"[:_CHARACTERS_MAX])
            lines += [f"    {line}"[:_CHARACTERS_MAX] for line in more]
    return lines


if __name__ == "__main__":
    for path in sorted(Path(sys.argv[1]).rglob("*.xml")):
        for line in failed(path):
            print(f"fcsl: failed: {line}")
